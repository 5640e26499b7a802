"""The hostile user campaign's short form: each command and the scripts' dry runs, lured as root."""

from __future__ import annotations

import pytest

pytest.importorskip("rerun")

from tests.campaigns import hostile_user
from tests.campaigns.trap import Trap


@pytest.mark.skipif(bool(hostile_user.why_not()), reason=hostile_user.why_not())
def test_no_file_of_another_user_is_loaded_or_written_through(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    # As /tmp is; pytest makes its folders for its own user alone.
    campaign = hostile_user.run_campaign(folder, print, short=True)
    assert campaign.violations == []
    assert campaign.counted["runs"] >= 20


@pytest.mark.skipif(bool(hostile_user.why_not()), reason=hostile_user.why_not())
def test_a_trap_separates_planted_files_from_those_of_neighbours(tmp_path_factory):
    trap = Trap(tmp_path_factory.mktemp("hostile") / "trap", hostile_user.kernel_folder())
    ours, theirs = trap.state / "run00004.rrd", trap.work / "json.py"
    ours.write_bytes(b"recorded by another process of ours")
    with trap.watched() as opened:
        ours.read_bytes()
        theirs.read_bytes()
    assert opened == {theirs}
