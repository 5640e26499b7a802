"""Buildings that robots share are measured: judged walks, an even share, who starts where."""

import json

import numpy as np
import pytest

from tests.benchmarks.__main__ import main
from tests.benchmarks.fleet import SPREAD, TOGETHER, starts_of


def test_two_robots_share_a_building_about_evenly(capsys):
    words = ["--generated", "1", "--cells", "1000", "--robots", "2", "--budget", "1", "--json"]
    assert main(["fleet", *words]) == 0
    (plan,) = json.loads(capsys.readouterr().out)["plans"]
    assert plan["bound_steps"] <= plan["longest_steps"]
    assert plan["ratio"] == pytest.approx(plan["longest_steps"] * 2 / plan["cells"], abs=1e-3)
    assert plan["ratio"] < 1.3
    assert plan["steps"] <= 2 * plan["longest_steps"]
    assert plan["passed_twice"] < 0.2


@pytest.mark.parametrize("how", [SPREAD, TOGETHER])
def test_robots_start_in_cells_of_their_own(how):
    reached = np.zeros((6, 9), np.bool_)
    reached[1:5, 2:8] = True
    starts = starts_of(reached, 5, how, seed=1)
    assert len(set(starts)) == 5
    assert all(reached[cell] for cell in starts)
    assert starts == starts_of(reached, 5, how, seed=1)
