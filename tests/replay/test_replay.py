"""One recording, played again as it was and as it might have been."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import pairwise

import pytest

pytest.importorskip("rerun")

from fasaco_edge.cli import main
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.replay.replay import Replay, read_run
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST
from tests.replay import scenarios
from tests.replay.scenarios import left, places, played
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

    The robot of the recording does not drive it: it went by the paths of then.
    """
    mission = story.mission
    if mission.state == "done":
        assert left(mission) == set()
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


def test_an_invalid_command_and_map_change_nothing_else(samples, config):
    pause, last_map = places(samples, "command")[0], places(samples, "map")[-1]
    samples = scenarios.changed(samples, pause, lambda _: b'{"command": "dance"}')
    story = played(scenarios.changed(samples, last_map, lambda payload: payload[:-5]), config)
    # Nothing to resume, then: that is refused, too, but not a fault of a sample.
    assert story.faults.count("bad_order") == 1
    assert "malformed_message" in story.faults
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


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (None, "No such file or directory"),
        ("hello", "this is no recording"),
        ("RRF2 and then nothing", "holds no samples"),
    ],
)
def test_a_file_that_is_no_recording_is_named(tmp_path, capsys, content, told):
    path = tmp_path / "a.rrd"
    if content is not None:
        path.write_text(content)
    assert main(["replay", str(path)]) == 1
    err = capsys.readouterr().err
    assert f"fasaco-edge: {path}: " in err
    assert told in err
    assert "hint: " in err
