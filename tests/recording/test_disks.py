"""A disk that fills up twice is told twice, and no part suffers; see ``disk_campaign`` for more."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.campaigns.recorder_disk import DISK, run_episodes
from tests.support.disks import disk_fixture

disk = disk_fixture(DISK)


def test_each_full_disk_is_told_once_and_all_parts_are_readable(disk):
    done = run_episodes(disk, episodes=2)
    assert done.on_log == done.in_recording == 2
    assert done.parts == 3
    assert done.rows > 0
    assert done.lost > 0
    assert done.exit_code == 0
