"""A daemon with a robot that stands: its path becomes better, what is needed comes first."""

from __future__ import annotations

import numpy as np

from tests.support.outsider import joined_daemon
from tests.support.rooms import WALL, fill, map_bytes, room, show_room


def large_room(pillars: int) -> np.ndarray:
    """Return a room of 24 m x 18 m with so many pillars, int8, 0.05 m a pixel."""
    pixels = room(24.0, 18.0)
    rng = np.random.default_rng(3)
    for _ in range(pillars):
        x, y = rng.uniform(1.5, 22.0), rng.uniform(1.5, 16.0)
        pixels = fill(pixels, x, y, x + 0.3, y + 0.3, WALL)
    return pixels


def test_a_hasty_plan_is_made_better_and_a_new_map_comes_first(tmp_path):
    hasty = {"budget_s": 0.002, "spare_share": 1.0}
    with joined_daemon(tmp_path, planner=hasty) as (_, outsider):
        show_room(outsider, large_room(40), 1.05, 1.05)
        first = outsider.wait_status(lambda status: status["path"])
        better = outsider.wait_status(
            lambda status: (
                status["path"]["reason"] == "better further on"
                and status["path"]["planned_cost_s"] < first["path"]["planned_cost_s"]
            )
        )
        assert better["plan"]["plans"] == 1
        assert better["plan"]["attempts"] > 0
        assert better["errors"]["total"] == 0
        outsider.put("map", map_bytes(large_room(41)))
        after = outsider.wait_status(lambda status: status["map"]["revision"] == 2)
        after = outsider.wait_status(lambda status: status["plan"]["plans"] > 1)
        assert after["state"] == "covering"
