"""The fleet's campaign in short: a kill, and a split."""

from __future__ import annotations

import pytest

from tests.campaigns.fleet_kills import TAKEN_OVER_S, Event, run_campaign


@pytest.mark.parametrize("event", ["kill", "split"])
def test_what_one_leaves_others_take_over(tmp_path, event: Event):
    campaign = run_campaign(tmp_path, {event: 1}, seed=3)
    assert campaign.violations == []
    assert campaign.counted[event] == 1
    assert max(campaign.taken_over_s[event]) <= TAKEN_OVER_S
