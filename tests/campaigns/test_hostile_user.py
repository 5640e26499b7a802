"""The hostile user campaign's short form: each command and the scripts' dry runs, lured as root."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.campaigns import hostile_user


@pytest.mark.timeout(600)
@pytest.mark.skipif(bool(hostile_user.why_not()), reason=hostile_user.why_not())
def test_nothing_that_another_user_has_prepared_is_loaded_or_written_through(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    # As /tmp is; pytest makes its folders for its own user alone.
    campaign = hostile_user.run_campaign(folder, print, short=True)
    assert campaign.violations == []
    assert campaign.counted["runs"] >= 20
