"""One recording, played again as it was and as it might have been."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import pairwise

import msgspec
import pytest

pytest.importorskip("rerun")

from fasaco_edge.cli import main
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.replay.replay import Replay, read_run
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST
from tests.replay import scenarios
from tests.replay.scenarios import driven_m, left, places, played, stands_on_unknown
from tests.support.processes import fasaco_edge
from tests.support.recorded_mission import record_mission


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return record_mission(tmp_path_factory.mktemp("recording"))


@pytest.fixture(scope="module")
def samples(recording):
    return list(RecordedSamples(recording.paths))


@pytest.fixture(scope="module")
def run(samples):
    return read_run(samples)


@pytest.fixture(scope="module")
def config(run):
    return run.daemon_config()


@pytest.fixture(scope="module")
def as_it_was(samples, config):
    return played(samples, config)


def assert_told(story):
    """Check that all is covered, or that the path in force leads over all that is left.

    The robot of the recording does not drive it: it went by the paths of then. So it may end on
    ground that the changed samples took from the map.
    """
    mission = story.mission
    if mission.state == "done":
        assert left(mission) == set()
    elif mission.state == "blocked":
        assert "unknown ground" in mission.reason
        assert stands_on_unknown(mission)
    else:
        assert mission.state == "covering", mission.reason
        assert left(mission) <= {(row, col) for row, col in mission.route.path.ahead.tolist()}


def test_the_recording_holds_what_scenarios_need(samples, run, recording):
    topics = [sample.topic for sample in samples]
    assert topics.count("map") >= 2
    assert topics.count("map_update") >= 10
    assert topics.count("pose") > 200
    commands = [sample.sample.payload for sample in samples if sample.topic == "command"]
    told = [json.loads(command)["command"] for command in commands]
    assert told == ["pause", "resume", "replan"]
    # The first path is the empty one with which the daemon begins.
    assert topics.count(PATH_DIGEST) == 1 + len(run.paths)
    assert len(run.paths) == recording.status["path"]["revision"]
    assert run.ready_ns is not None
    assert run.starts == run.restored_cells == 0
    assert all(a.at_ns <= b.at_ns for a, b in pairwise(samples))


def test_an_unchanged_recording_ends_as_recorded(as_it_was, recording):
    # By time alone: on a busy machine the daemon took other samples together, so that a pose came
    # after its map, and a path may lead over cells that the recorded robot had behind it. By cycles
    # a replay is the same throughout.
    assert_told(as_it_was)
    coverage = as_it_was.mission.coverage()
    again = len(left(as_it_was.mission))
    assert coverage.covered + again == recording.status["coverage"]["covered"]
    assert again <= 2
    assert as_it_was.faults == []
    plans = [step.decision.plan for step in as_it_was.news if step.decision.plan is not None]
    assert [plan.reason for plan in plans].count("asked for") == 1


def test_twice_it_is_the_same_bit_for_bit(as_it_was, samples, config):
    assert played(samples, config).outline() == as_it_was.outline()


@pytest.mark.parametrize("share", [0.0, 0.4, 0.8, 0.99])
def test_an_update_is_lost(samples, config, share):
    updates = places(samples, "map_update")
    assert_told(played(scenarios.without(samples, [updates[int(share * len(updates))]]), config))


@pytest.mark.parametrize(("topic", "late_s"), [("pose", 0.1), ("pose", 2.0), ("plan", 1.0)])
def test_poses_or_plans_come_late(samples, config, as_it_was, topic, late_s):
    """Robot and map have changed until then."""
    if topic == "pose":
        samples = scenarios.late(samples, topic, round(late_s * 1e9))
    else:
        planner = msgspec.structs.replace(config.planner, budget_s=late_s)
        config = msgspec.structs.replace(config, planner=planner)
    story = played(samples, config)
    assert_told(story)
    assert story.visited == as_it_was.visited


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_a_gap_without_poses_is_survived(samples, config, as_it_was, share):
    """It reappears far from where it was last seen: what lies between is not covered."""
    poses = places(samples, "pose")
    begin = int(share * len(poses))
    gone = poses[begin : begin + len(poses) // 4]
    # On a busy machine it may have stood all that while.
    while driven_m(samples, gone) < 1.5:
        gone = poses[begin : begin + len(gone) + 1]
    story = played(scenarios.without(samples, gone), config)
    assert_told(story)
    assert story.visited <= as_it_was.visited
    assert story.mission.covered.current.total < as_it_was.mission.covered.current.total


def test_without_resume_it_stays_paused(samples, config):
    story = played(scenarios.without(samples, places(samples, "command")[1:]), config)
    assert story.mission.state == "paused"
    assert not len(story.mission.route.path.ahead)


def test_an_invalid_command_changes_nothing_else(samples, config):
    pause = places(samples, "command")[0]
    story = played(scenarios.changed(samples, pause, lambda _: b'{"command": "dance"}'), config)
    # Nothing to resume, then: that is refused, too, but not a fault of a sample.
    assert story.faults == ["bad_order"]
    assert_told(story)


def test_an_invalid_map_changes_nothing_else(samples, config):
    last_map = places(samples, "map")[-1]
    story = played(scenarios.changed(samples, last_map, lambda payload: payload[:-5]), config)
    assert story.faults[0] == "malformed_message"
    assert story.mission.reason


def test_a_mission_that_begins_long_after_the_last_input_replays(samples, config):
    """On a slow machine a daemon still loads what it plans with when its last input comes."""
    statuses = [sample for sample in samples if sample.topic == "status"]
    told = [*places(samples, "status"), *places(samples, PATH_DIGEST)]
    inputs = scenarios.without(samples, told)[:40]
    later_ns = inputs[-1].wall_ns - samples[0].wall_ns + 20_000_000_000
    story = played([*inputs, *(scenarios.moved(status, later_ns) for status in statuses)], config)
    assert story.mission.state == "covering"
    assert story.news[0].at_s > 20.0


def test_with_other_work_paths_are_others(samples, config, run):
    found = []
    for work in (0, 200_000):
        replay = Replay(config, run.ready_ns, work)
        paths = [step.decision.path for step in replay.steps(samples) if step.decision.path]
        found.append([path.cells.tolist() for path in paths])
        assert_told(replay)
    assert found[0] != found[1]


def test_a_configuration_of_another_release_is_named(run):
    strange = replace(run, config={"robot": {"wings": 2}}, version="9.9")
    with pytest.raises(BadConfiguration, match=r"9\.9.*wings"):
        strange.daemon_config()


def test_the_command_tells_the_same_twice(recording, capsys, terminal_width):
    terminal_width(200)  # a narrow table breaks its words
    words = ["replay", *map(str, recording.paths)]
    assert main([*words, "--json"]) == 0
    out = capsys.readouterr().out
    again = fasaco_edge(*words, "--json")
    assert (again.code, again.out) == (0, out)
    told = json.loads(out)
    summary = told["summary"]
    assert summary["state"] == "done"
    assert summary["paths_recorded"] == recording.status["path"]["revision"]
    assert summary["samples_missing"] == 0
    paths = [step["path"] for step in told["decisions"] if "path" in step]
    assert len(paths) == summary["paths"]
    assert all(path["as_recorded"] for path in paths)
    assert len(paths[0]["cells_digest"]) == 32
    assert main([*words, "--work", "1000"]) == 0
    table = capsys.readouterr().out
    assert paths[0]["reason"].split()[0] in table
    # By time alone, see above.
    assert re.search(rf"\d+ of {summary['coverable_cells']} cells", table)
