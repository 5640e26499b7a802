"""The lab itself: what is done inside stays inside, and nothing of it is left."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.deploy.lab import booted, why_not
from tests.support.processes import is_running
from tests.support.waiting import until

MARK = "/etc/fasaco-edge-lab-was-here"
BOOT_AND_WAIT = """\
import sys, time
from pathlib import Path
from tests.deploy.lab import booted
with booted(Path(sys.argv[1]), {}) as lab:
    print(lab.pid, flush=True)
    time.sleep(60)
"""


def fail_in(folder: Path) -> None:
    with booted(folder, {}):
        raise AssertionError("a test that fails")


def cgroups() -> set[Path]:
    """The lab groups of this process.

    Other tests' labs come and go meanwhile: `os.walk` passes over a folder that is gone by the
    time it is read, where a pattern for `Path.glob` would raise.
    """
    mine = re.compile(rf"fasaco-lab-\d+-{os.getpid()}")
    folders = os.walk("/sys/fs/cgroup")
    return {Path(at, name) for at, names, _ in folders for name in names if mine.fullmatch(name)}


def test_files_written_inside_stay_inside(lab):
    lab.write(MARK, "here")
    assert lab.run("cat", MARK).stdout == "here"
    assert not Path(MARK).exists()


def test_a_lab_ends_with_the_process_that_booted_it(tmp_path):
    if reason := why_not():
        pytest.skip(reason)
    words = [sys.executable, "-c", BOOT_AND_WAIT, str(tmp_path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        systemd = int(process.stdout.readline())
        assert is_running(systemd)
        process.send_signal(signal.SIGKILL)
    until(lambda: not is_running(systemd))


def test_a_failed_lab_leaves_nothing_behind(tmp_path):
    if reason := why_not():
        pytest.skip(reason)
    before = cgroups()
    with pytest.raises(AssertionError, match="a test that fails"):
        fail_in(tmp_path)
    assert cgroups() == before
    # It is killed, and a busy machine may take a moment to end it.
    systemd = int((tmp_path / "pid").read_text())
    until(lambda: not is_running(systemd))
    assert str(tmp_path) not in Path("/proc/mounts").read_text()
