"""Statuses with all members, and with the largest and smallest numbers that a reader accepts."""

from __future__ import annotations

import copy
import functools
from collections.abc import Iterator
from typing import Any

from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.limits import MAX_JSON_INTEGER, MAX_JSON_NUMBER

FULL: dict[str, Any] = {
    "robot": "robot",
    "version": "1.0.0",
    "state": "covering",
    "reason": "path 1",
    "uptime_s": 1.0,
    "map": {"rows": 9, "cols": 9, "resolution_m": 0.1, "revision": 2, "stamp_ns": 5, "frame": "map",
            "lattice_deg": 1.0},
    "pose": {"x": 1.0, "y": 1.0, "yaw": 0.5},
    "coverage": {"coverable": 9, "covered": 3, "recovered": 1, "remaining": 6, "unreachable": 1,
                 "covered_m2": 0.5, "to_cover_m2": 1.0, "free_out_of_reach_m2": 0.5,
                 "fraction": 0.5},
    "floor": {"swept_m2": 1.0, "reachable_m2": 2.0, "left": [{"m2": 1.0, "reason": "narrow"}],
              "out_of_reach": [{"m2": 1.0, "reason": "narrow"}]},
    "path": {"revision": 1, "steps": 9, "remaining_steps": 4, "reason": "new map", "planner": "f",
             "seed": 1, "ants": 1, "kicks": 1, "proposals": 1, "planned_steps": 9,
             "planned_cost_s": 9.0, "lower_bound_steps": 8, "lower_bound_cost_s": 8.0, "gap": 0.1,
             "saved_by_ants_s": 1.0, "saved_by_local_search_s": 1.0,
             "saved_by_velocity_s": {"8": 1.0}},
    "plan": {"plans": 3, "unchanged": 1, "outdated": 1, "attempts": 1, "planning": False},
    "latency_ms": {"ingest": 1.0, "plan": 1.0, "map_to_path": 1.0},
    "loop_ms": {"turns": 9, "late": 1, "p50": 1.0, "p99": 1.0, "p99_9": 1.0, "max": 1.0},
    "drive": {"planned_quarter_turn_s": 1.0, "speed_m_s": 0.5, "quarter_turn_s": 1.0,
              "half_turn_s": 2.0, "turns": 3},
    "battery": {"level": 0.5, "power": "discharging", "age_s": 1.0, "drain_per_h": 0.2,
                "turns_back_at": 0.2, "goes_on_at": 0.9},
    "errors": {"total": 2, "last": "a fault", "by_code": {"malformed_message": 2}},
    "ledger": {"path": "robot.ledger", "age_s": 1.0, "restored_cells": 3, "fault": None},
    "recorder": {"state": "recording", "restarts": 1, "reason": "", "file": "a.rrd", "bytes": 5,
                 "messages": 5, "lost": 1, "malformed": 1, "rss_mb": 9.0, "cpu_s": 1.0, "pid": 7},
    "rss_mb": 99.0,
    "cpu_s": 1.0,
    "threads": 3,
    "config": {"robot": {"radius_m": 0.2, "tool_width_m": 0.3, "overlap": 0.1, "speed_m_s": 0.5},
               "map": {"free_at_most": 20, "occupied_at_least": 65},
               "mission": {"lost_pose_s": 1.0, "zones": [{"name": "hall", "polygon":
                           [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]}],
                           "keep_out": [[[2.0, 2.0], [3.0, 2.0], [3.0, 3.0]]]}},
    "mission": {"ordered": "ordered", "stage": "covering", "zone": "hall", "pass": 1, "passes": 2,
                "zones": [{"name": "hall", "passes": 2, "pass": 1, "cells": 9, "covered": 3,
                           "polygon": [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]}],
                "keep_out": 1, "home": {"x": 1.0, "y": 1.0}, "tries": 1,
                "waits_for_room": "kitchen", "left_out": ["bath"],
                "time_left_s": 60.0, "first_from": 70,
                "last_order": {"zones": [{"name": "hall"}]},
                "unreached": {"cells": 2, "m2": 0.2, "areas_left_out": 1, "areas": [
                    {"cells": 2, "m2": 0.2, "x": 2.0, "y": 1.0, "reason": "narrow"}]}},
    "fleet": {"name": "hall", "division": 1, "part_cells": 3, "members": [
        {"name": "r2", "state": "covering", "heard_s": 1.0, "away": None, "swept_cells": 2}]},
}  # fmt: skip

INTEGERS = (0, 1, MAX_JSON_INTEGER, -MAX_JSON_INTEGER)
NUMBERS = (0.0, -0.0, 1e-300, 1e-9, MAX_JSON_NUMBER, -MAX_JSON_NUMBER)
# Values that readers refuse, in place of the number of cells to cover.
MALFORMED = {
    "400 digits": "9" * 400,
    "NaN": "NaN",
    "1e308": "1e308",
    "negative": "-3",
    "text": '"many"',
    "nested": "[" * 900 + "]" * 900,
}


def malformed_status(name: str) -> bytes:
    """Return a status that is valid except for one member, see ``MALFORMED``."""
    mark = 123_454_321
    coverage = FULL["coverage"] | {"coverable": mark}
    mission = FULL["mission"] | {"zones": [FULL["mission"]["zones"][0] | {"cells": mark}]}
    payload = encode_json(FULL | {"coverage": coverage, "mission": mission}).decode()
    return payload.replace(str(mark), MALFORMED[name]).encode()


def extreme_statuses() -> Iterator[bytes]:
    """Yield statuses with one number, then all numbers, at the limits of documents."""
    places = list(_numbers(FULL))
    for place in places:
        extremes = INTEGERS if isinstance(_at(place), int) else NUMBERS
        for extreme in extremes:
            yield encode_json(_replaced(FULL, {place: extreme}))
    for integer in INTEGERS:
        for number in NUMBERS:
            both = {at: integer if isinstance(_at(at), int) else number for at in places}
            yield encode_json(_replaced(FULL, both))


Place = tuple[str | int, ...]


def _numbers(value: Any, place: Place = ()) -> Iterator[Place]:
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _numbers(item, (*place, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield place


def _at(place: Place) -> Any:
    return functools.reduce(lambda value, key: value[key], place, FULL)


def _replaced(document: dict[str, Any], numbers: dict[Place, float]) -> dict[str, Any]:
    changed = copy.deepcopy(document)
    for place, number in numbers.items():
        functools.reduce(lambda value, key: value[key], place[:-1], changed)[place[-1]] = number
    return changed
