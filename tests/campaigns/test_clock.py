"""The clock campaign's short form: a step back of a year, a start in 1970, one of it behind TLS."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.campaigns import clock, shifted_clock
from tests.support.secured import needs_openssl


@needs_openssl
@pytest.mark.skipif(bool(shifted_clock.why_not()), reason=shifted_clock.why_not())
def test_a_wrong_clock_deletes_nothing_newer_and_shows_true_ages(tmp_path):
    campaign = clock.run_campaign(tmp_path, boots=2, seed=0, hold_s=0.5, say=print)
    assert campaign.violations == []
    assert campaign.counted["boots"] == 2
    assert campaign.counted["boots behind TLS"] == 1
    assert campaign.counted["parts deleted"] > 0
