"""The fleet's campaign in short: a kill and a split, in one mission if both find the time."""

from __future__ import annotations

from tests.campaigns.fleet_kills import run_campaign


def test_other_robots_take_over_the_part_of_a_killed_one(tmp_path):
    # The campaign measures how long it takes; a busy machine takes several times as long.
    campaign = run_campaign(tmp_path, {"kill": 1, "split": 1}, seed=3, patience=6.0)
    assert campaign.violations == []
    assert campaign.counted["kill"] == campaign.counted["split"] == 1
