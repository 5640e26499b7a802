"""Short forms of the campaigns: a recorder that is killed, and a disk that is full."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.campaigns.kill_recorder import GOAL_LOST_S, run_campaign
from tests.campaigns.recorder_disk import DISK, run_episodes
from tests.support.disks import disk_fixture

disk = disk_fixture(DISK)
# The goal itself is the campaign's to measure: this machine may have others to serve, too.
PATIENCE_S = 9.0


def test_a_full_disk_is_reported_once_and_parts_stay_readable(disk):
    done = run_episodes(disk, episodes=2)
    assert done.on_log == done.in_recording == 2
    assert done.parts == 3
    assert done.rows > 0
    assert done.lost > 0
    assert done.exit_code == 0


def test_a_kill_costs_only_the_last_seconds():
    for kill in run_campaign(kills=3, seed=1):
        assert kill.parts
        assert kill.drawn_lost_s < GOAL_LOST_S + PATIENCE_S
        assert kill.heard_lost_s < GOAL_LOST_S + PATIENCE_S
