"""The come-and-go campaign's short form."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.campaigns import come_and_go

# What is random in the memory of processes this young says nothing of what grows.
YOUNG = ("rss_mb", "cores")


def test_participants_that_come_and_go_leave_nothing_behind(tmp_path):
    """With the daemon as hub, as by default: more of it has to be released than with a router."""
    campaign = come_and_go.run_campaign(tmp_path, mappers=10, daemons=3, rest_s=2.0, hub="daemon")
    # A look is short: on a busy machine it may contain no question.
    assert any(row.questions_hz > 0 for row in campaign.rows), "nobody was counted"
    assert [told for told in campaign.violations if not any(what in told for what in YOUNG)] == []
