"""A recorder that is killed leaves all but the last second; see ``kill_campaign`` for many."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.recording.kill_campaign import GOAL_LOST_S, run_campaign

# The machine that tests run on may have others to serve, too.
PATIENCE_S = 0.5


def test_a_kill_costs_a_second():
    for kill in run_campaign(kills=3, seed=1):
        assert kill.parts
        assert kill.drawn_lost_s < GOAL_LOST_S + PATIENCE_S
        assert kill.heard_lost_s < GOAL_LOST_S + PATIENCE_S
