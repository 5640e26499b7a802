"""Processes: what a child imports, and the memory limits of control groups."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fasaco_edge.host.processes import available_memory, ctrl_c_waits, memory_limit

TELL = """\
import subprocess
from fasaco_edge.host.processes import python_program
subprocess.run(python_program("platform"), check=True)
"""


@pytest.mark.parametrize("how", ["-P", "-I"])
def test_a_child_imports_nothing_of_the_working_folder(tmp_path: Path, how):
    (tmp_path / "fasaco_edge").mkdir()
    for name in ("platform.py", "json.py", "fasaco_edge/__init__.py"):
        (tmp_path / name).write_text("open('LOADED', 'w')\n")
    subprocess.run([sys.executable, how, "-c", TELL], cwd=tmp_path, check=True)
    assert not (tmp_path / "LOADED").exists()


OUT_OF_FILES = """
import resource
from fasaco_edge.host.processes import resident_mb, thread_count
before = resident_mb(), thread_count()
resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))
assert resident_mb() >= before[0] > 5
assert thread_count() == before[1] == 1
"""


def test_memory_and_threads_are_known_without_descriptors():
    subprocess.run([sys.executable, "-c", OUT_OF_FILES], check=True)


# A signal that arrives while the main thread is about to wait for the event, holding its lock.
STOP_IN_WAIT = """
import os, signal
from fasaco_edge.host.processes import stop_event
with stop_event() as stop:
    with stop._cond:
        os.kill(os.getpid(), signal.SIGTERM)
        signal.sigpending()
    print(stop.wait(10))
"""


def test_a_signal_inside_a_wait_is_not_lost_in_a_lock():
    program = [sys.executable, "-c", STOP_IN_WAIT]
    ended = subprocess.run(program, capture_output=True, text=True, timeout=20, check=True)
    assert ended.stdout == "True\n"


# The main thread holds the interpreter's lock for ever: no thread of Python's runs.
STUCK = """
import ctypes
from fasaco_edge.host.processes import end_within
end_within(2.0)
ctypes.PyDLL(None).sleep(50)
"""


def test_a_process_that_stands_still_ends_in_time_and_says_where():
    program = [sys.executable, "-c", STUCK]
    ended = subprocess.run(program, capture_output=True, text=True, timeout=40, check=False)
    assert ended.returncode == 1
    assert 'File "<string>", line 5 in <module>' in ended.stderr


def test_modules_are_started_only_by_python_program():
    package = Path(__file__).parents[2] / "fasaco_edge"
    found = [
        file.name
        for file in package.rglob("*.py")
        if '"-m"' in file.read_text() and file.name != "processes.py"
    ]
    assert found == []


def written(root, files):
    for path, text in files.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text)
    return root


@pytest.mark.parametrize(
    ("files", "limit"),
    [
        ({}, None),
        ({"proc/self/cgroup": "0::/a.slice/b.service\n"}, None),
        (
            {
                "proc/self/cgroup": "0::/a.slice/b.service\n",
                "sys/fs/cgroup/a.slice/b.service/memory.max": "max\n",
                "sys/fs/cgroup/a.slice/memory.max": "800000000\n",
            },
            800_000_000,
        ),
        (
            {
                "proc/self/cgroup": "4:memory:/b.service\n3:cpu:/\n0::/\n",
                "sys/fs/cgroup/memory/b.service/memory.limit_in_bytes": "671088640\n",
                "sys/fs/cgroup/memory/memory.limit_in_bytes": "9223372036854771712\n",
            },
            671_088_640,
        ),
        # Inside a namespace of control groups the root is one's own group.
        (
            {
                "proc/self/cgroup": "4:memory:/\n",
                "sys/fs/cgroup/memory/memory.limit_in_bytes": "671088640\n",
            },
            671_088_640,
        ),
    ],
    ids=["nowhere", "no files", "version 2", "version 1", "namespace"],
)
def test_the_limit_is_that_of_the_group_and_those_above(tmp_path, files, limit):
    assert memory_limit(written(tmp_path, files)) == limit


def test_available_memory_is_at_most_the_limit(tmp_path):
    free = {"proc/meminfo": "MemTotal: 4000000 kB\nMemAvailable: 2000000 kB\n"}
    assert available_memory(written(tmp_path / "free", free)) == 2_048_000_000
    limited = free | {
        "proc/self/cgroup": "0::/b.service\n",
        "sys/fs/cgroup/b.service/memory.max": "800000000\n",
    }
    assert available_memory(written(tmp_path / "limited", limited)) == 800_000_000


def test_ctrl_c_waits_for_the_end_of_a_protected_block():
    before, reached = signal.signal(signal.SIGINT, signal.default_int_handler), []

    def interrupted(error=None):
        with ctrl_c_waits():
            os.kill(os.getpid(), signal.SIGINT)
            if error is not None:
                raise error
            reached.append(True)

    try:
        for error in (None, OSError()):
            with pytest.raises(KeyboardInterrupt):
                interrupted(error)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        with ctrl_c_waits():
            pass
        signal.signal(signal.SIGINT, lambda *_: reached.append("handled"))
        with ctrl_c_waits():
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert reached == [True, "handled"]
