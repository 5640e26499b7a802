"""The power is cut at some writes of a mission; the campaign cuts at all of them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.campaigns import power_cut
from tests.campaigns.file_calls import Kind, Watch, why_not
from tests.campaigns.power_states import Bytes, Cut, Disk, Names, cuts_of
from tests.support.ledgers import contents

pytestmark = pytest.mark.skipif(bool(why_not()), reason=why_not())

WRITES = """
import os, sys
from pathlib import Path
folder = Path(sys.argv[1])
kept, lost = folder / "kept", folder / "lost"
with kept.open("wb") as file:
    file.write(b"12345678")
    file.flush()
    os.fsync(file.fileno())
os.replace(kept, folder / "moved")
at = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
os.fsync(at)
os.close(at)
lost.write_bytes(b"abcdefgh")
os.replace(folder / "moved", folder / "gone")
"""


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    """A small program's calls, and the folder they were made in."""
    root = tmp_path_factory.mktemp("small")
    with Watch([root], is_logged=True) as watch:
        environment = os.environ | watch.environment
        subprocess.run([sys.executable, "-c", WRITES, str(root)], env=environment, check=True)
        return root, watch.calls()


def left(trace, folder: Path, after: int, how: Bytes, names: Names) -> dict[str, bytes]:
    """Return what a cut leaves, by name."""
    root, calls = trace
    disk = Disk(root)
    for call in calls[:after]:
        disk.do(call)
    disk.write(Cut(after, how, names, 0), folder)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_calls_are_seen_in_their_order(trace):
    _, calls = trace
    kinds = [Kind.OPEN, Kind.WRITE, Kind.SYNC, Kind.RENAME, Kind.SYNC]
    assert [call.kind for call in calls] == [*kinds, Kind.OPEN, Kind.WRITE, Kind.RENAME]
    assert [call.data for call in calls if call.data] == [b"12345678", b"abcdefgh"]


@pytest.mark.parametrize(
    ("after", "how", "names", "what"),
    [
        (2, Bytes.WHOLE, Names.NONE, {}),
        (2, Bytes.WHOLE, Names.ALL, {"kept": b"12345678"}),
        (2, Bytes.EMPTY, Names.ALL, {"kept": b""}),
        (2, Bytes.ZEROED, Names.ALL, {"kept": bytes(8)}),
        (2, Bytes.HALF, Names.ALL, {"kept": b"1234"}),
        (2, Bytes.ZERO_TAIL, Names.ALL, {"kept": b"1234\0\0\0\0"}),
        (4, Bytes.ZEROED, Names.ALL, {"moved": b"12345678"}),
        (4, Bytes.ZEROED, Names.NONE, {}),
        (5, Bytes.ZEROED, Names.NONE, {"moved": b"12345678"}),
        (8, Bytes.OLD, Names.NONE, {"moved": b"12345678"}),
        (8, Bytes.OLD, Names.ALL, {"gone": b"12345678", "lost": b""}),
    ],
)
def test_only_synchronised_data_survives_a_power_cut(trace, tmp_path, after, how, names, what):
    assert left(trace, tmp_path, after, how, names) == what


def test_no_call_is_left_out(trace):
    root, calls = trace
    assert {cut.after for cut in cuts_of(root, calls, 10**6, 0)} == set(range(len(calls) + 1))
    some = cuts_of(root, calls, 20, 0)
    assert len(some) == 20
    assert {cut.after for cut in some} == set(range(len(calls) + 1))


def test_a_daemon_starts_after_some_cuts_of_a_mission(tmp_path):
    """Long form: python -m tests.campaigns.power_cut --cuts 2000."""
    (tmp_path / "mission").mkdir()
    mission = power_cut.watched_mission(tmp_path / "mission", seconds=1.0)
    history = [written.holds for written in power_cut.ledgers_of(mission)]
    assert len(history) > 3
    assert contents(None) in history[1:], "the mission began anew by command"
    cuts = cuts_of(mission.root, mission.calls, 2, 0)
    outcomes = list(power_cut.outcomes_of(mission, cuts, tmp_path, tmp_path))
    assert len(outcomes) == 2
    assert not [outcome for outcome in outcomes if outcome.wrong]
