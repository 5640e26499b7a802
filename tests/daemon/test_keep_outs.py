"""Keep-outs and consent on a real bus: a command each, and what a kill leaves of them."""

from __future__ import annotations

import json
from typing import Any

from tests.daemon.test_commands import ask, command
from tests.daemon.test_mission import about, planned
from tests.support.outsider import Outsider, joined_daemon
from tests.support.rooms import begin, cells_of, drive, lanes
from tests.wire.schemas import check

# A square of 4 x 4 cells in the hall, and the cells that the robot's rim would touch it from.
VASE = {"name": "vase", "polygon": [[0.9, 0.9], [2.1, 0.9], [2.1, 2.1], [0.9, 2.1]]}
AROUND = {(row, col) for row in range(2, 8) for col in range(2, 8)}


def keep_out(outsider: Outsider, action: str, area: dict[str, Any]) -> dict[str, Any]:
    asked = {"command": f"keep_out_{action}", "keep_out": area}
    check("mission.json", asked)
    return ask(outsider, json.dumps(asked).encode())


def test_a_keep_out_in_mid_mission_keeps_coverage_and_is_avoided(tmp_path):
    with joined_daemon(tmp_path) as (_, outsider):
        paths, taken = outsider.listen("path"), outsider.listen("command", late=False)
        begin(outsider)
        covered = drive(outsider, lanes(12))["coverage"]["covered"]
        before = len(paths.heard)
        answer = keep_out(outsider, "add", VASE)
        check("reply.json", answer)
        assert answer["coverage"]["covered"] == covered == 12
        assert answer["mission"]["keep_out"] == 1
        assert answer["mission"]["keep_outs"] == [{**VASE, "by": "operator"}]
        paths.wait(lambda heard: about(heard)["plan_ms"] > 0, since=before)
        for heard in paths.heard[before:]:
            assert not set(cells_of(planned(heard)[0])) & AROUND
        assert taken.wait(lambda _: True).json() == {"command": "keep_out_add", "keep_out": VASE}
        status = outsider.wait_status(lambda status: status["mission"]["keep_outs"])
        assert status["mission"]["keep_outs"][0]["name"] == "vase"

        gone = keep_out(outsider, "remove", {"name": "vase"})
        assert (gone["mission"]["keep_out"], gone["coverage"]["covered"]) == (0, 12)
        assert gone["troubles"] == []


def test_it_outlives_a_kill_and_comes_before_any_map(tmp_path):
    with joined_daemon(tmp_path) as (running, outsider):
        assert keep_out(outsider, "add", VASE)["state"] == "waiting for map"
        running.kill()
    with joined_daemon(tmp_path) as (running, outsider):
        paths = outsider.listen("path")
        assert outsider.ask_status()["mission"]["keep_outs"] == [{**VASE, "by": "operator"}]
        begin(outsider)
        heard = paths.wait(lambda heard: len(planned(heard)[0]) > 0)
        assert not set(cells_of(planned(heard)[0])) & AROUND
        running.kill()
    # Without a map, too, it can be removed.
    with joined_daemon(tmp_path) as (_, outsider):
        assert keep_out(outsider, "remove", {"name": "vase"})["mission"]["keep_outs"] == []


def test_a_keep_out_before_a_map_forgets_nothing_in_the_ledger(tmp_path):
    with joined_daemon(tmp_path) as (_, outsider):
        begin(outsider)
        drive(outsider, lanes(12))
    with joined_daemon(tmp_path) as (_, outsider):
        for name, order in (("start", {"passes": 2}), ("reset", None)):
            error = command(outsider, name, order, discard=False)
            assert error["code"] == "would_forget"
            assert error["message"] == f"{name} forgets up to 11 covered cells (1.0 m2)"
        assert outsider.ask_status()["mission"]["ordered"] == "itself"
        # The same order, and one that keeps what is covered, lose nothing.
        for order in ({}, {"passes": 2, "keep_covered": True}):
            assert "code" not in command(outsider, "start", order, discard=False)
        assert outsider.ask_status()["ledger"]["restored_cells"] == 12
