"""A recorder that is killed leaves all but the last second; see ``kill_campaign`` for many."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.campaigns.kill_recorder import GOAL_LOST_S, run_campaign

# The goal itself is the campaign's to measure: this machine may have others to serve, too.
PATIENCE_S = 9.0


def test_a_kill_costs_what_was_said_last():
    for kill in run_campaign(kills=3, seed=1):
        assert kill.parts
        assert kill.drawn_lost_s < GOAL_LOST_S + PATIENCE_S
        assert kill.heard_lost_s < GOAL_LOST_S + PATIENCE_S
