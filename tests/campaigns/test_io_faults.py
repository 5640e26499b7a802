"""Some file calls of the daemon and the recorder fail; the campaign lets all of them fail."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.campaigns.file_calls import Failure, Kind, Watch, why_not
from tests.campaigns.io_faults import failures_of, outcome_of
from tests.support.processes import ENVIRONMENT, PROGRAM

pytestmark = pytest.mark.skipif(bool(why_not()), reason=why_not())

ENDS_A_PART = """
import logging, pathlib, sys
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.part import Flush, RecordingPart
logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stdout)
part = RecordingPart(pathlib.Path(sys.argv[1], "run-part1.rrd"), "run")
part.stream.log("text", rr.TextLog("hello"))
assert part.flush(60.0) is Flush.DONE
part.close()
"""
READS = "import sys; sys.stdout.write(open(sys.argv[1]).read() + open(sys.argv[1]).read())"


@pytest.mark.parametrize(
    ("failure", "printed", "code"),
    [
        (None, "helloworldhelloworld", 0),
        (Failure(Kind.READ, 1, "short"), "helloworldhelloworld", 0),
        (Failure(Kind.READ, 1, "EINTR"), "helloworldhelloworld", 0),
        (Failure(Kind.OPEN, 2, "EIO"), "", 1),
        (Failure(Kind.OPEN, 3, "EIO"), "helloworldhelloworld", 0),
        (Failure(Kind.READ, 1, "EIO", for_good=True), "", 1),
    ],
)
def test_the_call_that_is_named_fails_and_no_other(tmp_path, failure, printed, code):
    file = tmp_path / "file"
    file.write_text("helloworld")
    with Watch([tmp_path], failure) as watch:
        command = [sys.executable, "-c", READS, str(file)]
        environment = os.environ | watch.environment
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (done.stdout, done.returncode) == (printed, code)
        is_reached = failure is not None and failure.at < 3
        assert watch.failed_on() == (str(file) if is_reached else None)
        assert "Input/output error" in done.stderr or code == 0


def test_a_failure_is_written_as_it_is_read():
    for failure in failures_of({Kind.OPEN: 2, Kind.SYNC: 1}, 0, 0, every=True):
        assert Failure.of_text(str(failure)) == failure
    with pytest.raises(ValueError, match="no such error"):
        Failure.of_text("open:1:ENONE")


def test_the_rarest_calls_come_first_and_no_kind_is_left_out():
    counts = {Kind.READ: 600, Kind.SYNC: 3, Kind.OPEN: 300, Kind.MAP: 0}
    chosen = failures_of(counts, 20, 0, every=False)
    expected = [Kind.SYNC] * 3 + [Kind.OPEN] * 20 + [Kind.READ] * 20
    assert [failure.kind for failure in chosen] == expected


@pytest.mark.parametrize(
    "fault",
    [
        "orders:open:1:EIO",
        "orders:read:2:EIO",
        "orders:sync:1:EIO+",
        "recorder:write:2:ENOSPC",  # the first message of a part
        "recorder:write:4:EIO",
        "recorder:write:9:ENOSPC",
        "recorder:folder:1:EIO",
    ],
)
def test_an_io_fault_is_reported_and_loses_nothing(fault):
    """Long form: python -m tests.campaigns.io_faults."""
    name, _, text = fault.partition(":")
    outcome, _ = outcome_of(name, Failure.of_text(text))
    assert outcome.came != "wrong", outcome
    assert outcome.on, "the call was made"


def test_an_unreadable_recording_does_not_stop_the_recorder(tmp_path):
    old = tmp_path / "old.rrd"
    old.write_bytes(b"RRF2 and so on")
    script = "import sys; from pathlib import Path; from fasaco_edge.recording.read import torn; "
    script += "print(*torn.repair_folder(Path(sys.argv[1])))"
    with Watch([tmp_path], Failure(Kind.READ, 1, "EIO")) as watch:
        command = [sys.executable, "-c", script, str(tmp_path)]
        environment = ENVIRONMENT | watch.environment
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == "old.rrd could not be checked: Input/output error\n", done.stderr


@pytest.mark.parametrize("at", [6, 7, 8, None])  # of the footer, and of what stands behind it
def test_a_failed_write_of_the_end_of_a_part_is_reported(tmp_path, at):
    failure = None if at is None else Failure(Kind.WRITE, at, "EIO")
    with Watch([tmp_path], failure) as watch:
        command = [sys.executable, "-c", ENDS_A_PART, str(tmp_path)]
        environment = ENVIRONMENT | watch.environment
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert bool(watch.failed_on()) == (at is not None)
    assert done.stdout == ("run-part1.rrd: its footer could not be written\n" if at else "")


@pytest.mark.parametrize(
    "failure", [f"look:{at}:{error}+" for at in (1, 2, 3) for error in ("EIO", "EACCES")]
)
def test_a_failing_kernel_folder_gives_an_error_and_no_traceback(tmp_path, failure):
    with Watch([tmp_path], Failure.of_text(failure)) as watch:
        environment = ENVIRONMENT | {"NUMBA_CACHE_DIR": str(tmp_path)} | watch.environment
        command = [*PROGRAM, "warmup", "--check"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert watch.failed_on()
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith(("kernels not ready: ", str(tmp_path)))
