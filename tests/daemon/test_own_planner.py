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

MOODS = {10: depth_first, 20: depth_first, 12: fail, 14: lambda problem: [problem.start], 16: hang,
         18: lambda problem: os._exit(0)}
"""
GOOD, RAISES, ILLEGAL, HANGS, EXITS, GOOD_AGAIN = 10, 12, 14, 16, 18, 20
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
    """Show a map of this width, larger than the one before.

    Return who has planned on it, and the codes of all errors until then.
    """
    paths = client.listen("path", late=False)
    client.put("map", map_bytes(room(0.3 * cells, 2.4)))
    deadline = time.monotonic() + 60.0
    while True:
        client.put("pose", pose_bytes(0.75, 0.75))
        notes = [json.loads(path.attachment) for path in paths.heard if path.attachment]
        made = [note for note in notes if note["planner"]]
        status = client.ask_status()
        # The status may be a second older than the path.
        if made and (status["path"] or {"revision": 0})["revision"] >= made[0]["revision"]:
            return made[0]["planner"], status["errors"]
        assert time.monotonic() < deadline, status
        time.sleep(0.1)


def test_it_plans_and_what_it_does_costs_one_plan(planning):
    planner, errors = planned_on(planning, GOOD)
    assert (planner, errors["total"]) == (PLACE, 0)
    planner, errors = planned_on(planning, RAISES)
    assert (planner, set(errors["by_code"])) == ("zigzag", {"planner_failed"})
    assert "RuntimeError: of no use" in errors["last"]
    assert "\x1b" not in errors["last"]
    planner, errors = planned_on(planning, ILLEGAL)
    assert (planner, set(errors["by_code"])) == ("zigzag", {"planner_failed", "illegal_walk"})
    assert "its walk leaves" in errors["last"]
    planner, _ = planned_on(planning, GOOD_AGAIN)
    assert planner == PLACE


@pytest.mark.parametrize(
    ("cells", "said"), [(HANGS, "no walk within 5 s"), (EXITS, "its process has ended")]
)
def test_one_that_hangs_or_ends_is_not_asked_again(planning, cells, said):
    planned_on(planning, GOOD)
    planner, errors = planned_on(planning, cells)
    assert (planner, errors["by_code"]) == ("zigzag", {"planner_failed": 1})
    assert f"planner {PLACE}: {said}" in errors["last"]
    planner, errors = planned_on(planning, GOOD_AGAIN)
    assert (planner, errors["total"]) == ("zigzag", 1)


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
        planner, errors = planned_on(client, GOOD)
    assert (planner, errors["by_code"]) == ("fasaco", {"bad_configuration": 1})
    assert f"planner.own: {PLACE}: {open_to_all} may be written by everybody" in (errors["last"])
    assert not mark.exists()


@pytest.mark.parametrize("place", ["mine.py:walk", "/tmp/mine.py:walk", "mine", "a-b:c"])
def test_a_configuration_names_a_module_alone(tmp_path, place):
    (tmp_path / "robot.yaml").write_text(f"planner:\n  own: {place}\n")
    with pytest.raises(BadConfiguration, match=r"planner\.own must be MODULE:NAME"):
        load_config(tmp_path / "robot.yaml")
