"""What a command would lose: asked for on a terminal, refused elsewhere; keep-outs lose nothing."""

from __future__ import annotations

import json

import pytest

from tests.support.outsider import joined_daemon
from tests.support.processes import fasaco_edge
from tests.support.rooms import begin, drive, lanes
from tests.support.terminal import Terminal

LOSS = "start forgets 11 covered cells (1.0 m2)"
VASE = "0.9,0.9;2.1,0.9;2.1,2.1;0.9,2.1"


@pytest.fixture
def robot(tmp_path):
    with joined_daemon(tmp_path) as (running, outsider):
        begin(outsider)
        drive(outsider, lanes(12))
        yield running, outsider


def mission(running, *words):
    return fasaco_edge("mission", *words, "--connect", running.endpoint)


def covered(outsider):
    return outsider.ask_status()["coverage"]["covered"]


def on_terminal(answer, *words):
    with Terminal(*words, columns=200) as shell:
        shell.wait_text("[y/N]")
        shell.type(answer)
        return shell.end(), shell.written


def test_without_a_terminal_it_is_refused_and_says_how_much(robot):
    running, outsider = robot
    for words in (("start", "--passes", "2"), ("reset",)):
        refused = mission(running, *words)
        assert (refused.code, refused.out) == (1, "")
        assert f"{words[0]} forgets 11 covered cells (1.0 m2)" in refused.err
        assert " % of the floor in reach" in refused.err
        assert "--yes" in refused.err
        document = mission(running, *words, "--json")
        assert (document.code, json.loads(document.out)["code"]) == (1, "would_forget")
    assert covered(outsider) == 12
    assert mission(running, "start").code == 0, "the same order goes on"
    assert mission(running, "start", "--passes", "2", "--keep-covered").code == 0
    assert covered(outsider) == 12
    assert mission(running, "start", "--passes", "3", "--yes").code == 0
    outsider.wait_status(lambda status: status["coverage"]["covered"] == 1)


def test_a_terminal_asks_and_only_yes_changes_anything(robot):
    running, outsider = robot
    words = "mission", "start", "--passes", "2", "--connect", running.endpoint
    for answer in ("n\n", "\n", "\x04"):
        code, written = on_terminal(answer, *words)
        assert code == 1, written
        assert LOSS in written
        assert "nothing was changed" in written
        assert covered(outsider) == 12
    code, written = on_terminal("y\n", *words)
    assert code == 0, written
    assert "pass 1 of 2" in written
    outsider.wait_status(lambda status: status["coverage"]["covered"] == 1)


def test_a_keep_out_in_mid_mission_loses_nothing(robot):
    running, outsider = robot
    added = mission(running, "keep-out", "add", "--name", "vase", VASE)
    assert added.code == 0
    assert "1: vase" in added.out
    # Negative corners are no options.
    corners = "-3,-1", "-2,-1", "-2,0"
    assert mission(running, "keep-out", "add", "--name", "lamp", *corners).code == 0
    assert covered(outsider) == 12
    listed = mission(running, "keep-out", "list")
    for word in ("vase", "lamp", "the operator", "(0.90, 0.90)"):
        assert word in listed.out
    document = json.loads(mission(running, "keep-out", "list", "--json").out)
    assert [(each["name"], len(each["polygon"])) for each in document] == [("vase", 4), ("lamp", 3)]
    assert mission(running, "keep-out", "remove", "vase").code == 0
    again = mission(running, "keep-out", "remove", "vase")
    assert again.code == 1
    assert "no keep-out 'vase' was added; there are 'lamp'" in again.err
    assert outsider.ask_status()["mission"]["keep_out"] == 1
    assert covered(outsider) == 12
