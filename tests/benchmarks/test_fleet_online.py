"""Fleets in unknown buildings are measured: against one robot, on the way, in each other's way."""

import json

from tests.benchmarks.__main__ import main


def test_robots_share_an_unknown_building_without_touching(capsys):
    words = ["--maps", "flat", "--generated", "0", "--robots", "3", "--json"]
    assert main(["fleet-online", *words]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert run["time_ratio"] < 0.5
    assert run["twice"] < 0.15
    assert run["touches"] == 0
