"""A planner of the user's own in the daemon: it plans, and whatever it does, the daemon goes on."""

from __future__ import annotations

import json
import time

import pytest

from fasaco_edge.config.loading import load_config
from fasaco_edge.errors import BadConfiguration
from tests.offline.test_plan import OWN_PLANNER
from tests.support.outsider import Outsider
from tests.support.processes import daemon_process
from tests.support.rooms import map_bytes, pose_bytes, room

# What the planner does is chosen by the map's width, in cells of 0.3 m.
MODULE = """
import os, sys, time

class Moody:
    def plan(self, problem):
        print("noise", flush=True)
        return MOODS[problem.to_cover.shape[1]](problem)

def fail(problem):
    raise RuntimeError("of no use\\x1b[31m")

def hang(problem):
    while True:
        pass

MOODS = {10: depth_first, 12: fail, 14: lambda problem: [problem.start], 16: hang,
         18: lambda problem: os._exit(0)}
"""
GOOD, RAISES, ILLEGAL, HANGS, EXITS = 10, 12, 14, 16, 18
PLACE = "plans_of_mine:Moody"


@pytest.fixture
def planning(tmp_path):
    (tmp_path / "plans_of_mine.py").write_text(OWN_PLANNER + MODULE)
    with (
        daemon_process(
            tmp_path, env={"PYTHONPATH": str(tmp_path)}, planner={"own": PLACE, "name": "zigzag"}
        ) as running,
        Outsider(running.endpoint) as client,
    ):
        yield client


def planned_on(client, cells):
    """Show a map of this width; return the status once it has been planned on."""
    before = (client.ask_status()["path"] or {"revision": 0})["revision"]
    client.put("map", map_bytes(room(0.3 * cells, 2.4)))
    deadline = time.monotonic() + 60.0
    while True:
        client.put("pose", pose_bytes(0.75, 0.75))
        status = client.ask_status()
        if (status["path"] or {"revision": 0})["revision"] > before:
            return status
        assert time.monotonic() < deadline, status
        time.sleep(0.1)


def planner_of(client):
    return json.loads(client.ask("@rpc/path").attachment)["planner"]


def test_it_plans_and_what_it_does_costs_one_plan(planning):
    assert planned_on(planning, GOOD)["errors"]["total"] == 0
    assert planner_of(planning) == PLACE
    status = planned_on(planning, RAISES)
    assert planner_of(planning) == "zigzag"
    assert status["errors"]["by_code"] == {"planner_failed": 1}
    assert "RuntimeError: of no use" in status["errors"]["last"]
    assert "\x1b" not in status["errors"]["last"]
    status = planned_on(planning, ILLEGAL)
    assert status["errors"]["by_code"] == {"planner_failed": 1, "illegal_walk": 1}
    assert "its walk leaves" in status["errors"]["last"]
    planned_on(planning, GOOD)
    assert planner_of(planning) == PLACE


@pytest.mark.parametrize(
    ("cells", "said"), [(HANGS, "no walk within 5 s"), (EXITS, "its process has ended")]
)
def test_one_that_hangs_or_ends_is_not_asked_again(planning, cells, said):
    planned_on(planning, GOOD)
    status = planned_on(planning, cells)
    assert status["errors"]["by_code"] == {"planner_failed": 1}
    assert f"planner {PLACE}: {said}" in status["errors"]["last"]
    planned_on(planning, GOOD)
    assert planner_of(planning) == "zigzag"


def test_one_that_anybody_could_have_written_is_not_run(tmp_path):
    open_to_all = tmp_path / "open"
    open_to_all.mkdir()
    open_to_all.chmod(0o777)
    mark = tmp_path / "was_run"
    (open_to_all / "plans_of_mine.py").write_text(f"open({str(mark)!r}, 'w')\n")
    with (
        daemon_process(
            tmp_path, env={"PYTHONPATH": str(open_to_all)}, planner={"own": PLACE}
        ) as running,
        Outsider(running.endpoint) as client,
    ):
        status = planned_on(client, GOOD)
        assert planner_of(client) == "fasaco"
    assert status["errors"]["by_code"] == {"bad_configuration": 1}
    assert (
        f"planner.own: {PLACE}: {open_to_all} may be written by everybody"
        in (status["errors"]["last"])
    )
    assert not mark.exists()


@pytest.mark.parametrize("place", ["mine.py:walk", "/tmp/mine.py:walk", "mine", "a-b:c"])
def test_a_configuration_names_a_module_alone(tmp_path, place):
    (tmp_path / "robot.yaml").write_text(f"planner:\n  own: {place}\n")
    with pytest.raises(BadConfiguration, match=r"planner\.own must be MODULE:NAME"):
        load_config(tmp_path / "robot.yaml")
