"""The recorder-hour campaign's short form."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.campaigns.recorder_hour import record_mission


def test_a_minute_of_a_mission_is_recorded_in_bounds(tmp_path):
    hour = record_mission(tmp_path, 60)
    assert hour.parts == 1
    assert hour.messages > 60 * 20
    # The first map is as large as many of its changes.
    assert 1.0 < hour.mb_per_hour < 200.0
