"""Processes: starting this interpreter again, signals, memory and threads by proc(5)."""

from __future__ import annotations

import _thread
import ctypes
import faulthandler
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from types import FrameType


def python_program(module: str, *words: str) -> list[str]:
    """Return the command line that runs a module with this interpreter.

    ``-m`` alone would first search the working folder, which others may write to. An isolated
    interpreter starts another isolated one, whose imports ignore environment and home.
    """
    shut = "-I" if sys.flags.isolated else "-P"
    return [sys.executable, shut, "-m", module, *words]


MB = 1_000_000
# Options of mallopt(3), and the values set. Lower thresholds would return more memory, but each
# page of 4 KB mapped again costs a page fault: with 256 KB, replans of 100,000 cells take 60 ms,
# not 38.
_TRIM_THRESHOLD = (-1, 2 << 20)
_MMAP_THRESHOLD = (-3, 1 << 20)
_ARENA_MAX = (-8, 2)


def resident_mb(pid: int | str = "self") -> float:
    """Return the resident memory of a process now [MB]; by default of this process."""
    return _field_mb(pid, "VmRSS")


def own_mb(pid: int | str = "self") -> float:
    """Return a process's resident memory without pages of files [MB].

    Pages of files, as of libraries, are shared, and the system reclaims them at any time.
    """
    return _field_mb(pid, "RssAnon")


def peak_mb(pid: int | str = "self") -> float:
    """Return a process's peak resident memory [MB]."""
    return _field_mb(pid, "VmHWM")


def memory_limit(root: Path = Path("/")) -> int | None:
    """Return this process's memory limit by control groups [bytes]; None if none is known.

    It is the lowest limit of the process's group and of the groups above it that are visible.
    """
    try:
        groups = (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    found = []
    for line in groups:
        _, controllers, place = line.split(":", 2)
        if controllers not in ("", "memory"):
            continue
        top, name = ("sys/fs/cgroup/memory", "memory.limit_in_bytes") if controllers else (
            "sys/fs/cgroup", "memory.max"
        )  # fmt: skip
        folder = root / top / place.lstrip("/")
        for group in (folder, *folder.parents):
            if group == root / "sys/fs":
                break
            try:
                text = (group / name).read_text(encoding="ascii").strip()
            except OSError:
                continue
            if text.isdecimal():
                found.append(int(text))
    # In version 1 of control groups, a number near 2^63 means no limit.
    limits = [limit for limit in found if limit < 1 << 60]
    return min(limits, default=None)


def available_memory(root: Path = Path("/")) -> int:
    """Return the memory that this process can still get without swapping [bytes]."""
    text = (root / "proc/meminfo").read_text(encoding="ascii")
    free = next(line for line in text.splitlines() if line.startswith("MemAvailable:"))
    available = int(free.split()[1]) * 1024
    return min(available, memory_limit(root) or available)


def thread_count() -> int:
    """Return the number of threads of this process."""
    return int(_fields("self")["Threads"])


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process and its threads, including ended threads [s].

    Raises:
        OSError: the process has ended.
    """
    # As clock_getcpuclockid(3) derives the clock of a process from its id.
    return time.clock_gettime((~pid << 3) | 2)


def _field_mb(pid: int | str, name: str) -> float:
    # A process that has ended, but whose parent has not waited for it, has no memory.
    kilobytes = _fields(pid).get(name, "0").split()[0]
    return round(int(kilobytes) * 1024 / 1e6, 1)


def _fields(pid: int | str) -> dict[str, str]:
    """Return a process's fields of proc(5); of this process even without a free descriptor."""
    if pid == "self":
        text = os.pread(_own_status(), 1 << 16, 0).decode("ascii", errors="replace")
    else:
        text = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    return {key: value for key, _, value in (line.partition(":") for line in text.splitlines())}


@lru_cache(maxsize=1)
def _own_status() -> int:
    return os.open("/proc/self/status", os.O_RDONLY | os.O_CLOEXEC)


def release_unused() -> None:
    """Return freed memory of the calling thread's arena to the system, if the C library can."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def return_soon() -> None:
    """Let the C library return freed memory to the system soon, if it can (glibc).

    By default glibc keeps freed large blocks, in an arena for each thread: 15 MB in a recorder of
    large maps. Call this before the process has threads.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for option, value in (_ARENA_MAX, _MMAP_THRESHOLD, _TRIM_THRESHOLD):
            mallopt(option, value)


PARENT_PERIOD_S = 0.5


def call_on(*numbers: int, call: Callable[[], None]) -> Callable[[], None]:
    """Call ``call`` on each of these signals; return a function that restores the old handlers.

    ``call`` runs on a thread of its own. A handler would interrupt the main thread, which may hold
    a lock that ``call`` needs, such as that of an event. Only the main thread may handle signals:
    on any other thread this function does nothing.
    """
    return _handle(numbers, lambda: _call_apart(call))


def end_within(seconds: float) -> None:
    """End this process if it still exists after a timeout [s]: code 1, its stacks on stderr.

    This works even if the interpreter is blocked, as a C thread does it.
    """
    with suppress(AttributeError, OSError, RuntimeError, ValueError):  # no stderr, or no file
        faulthandler.dump_traceback_later(seconds, exit=True)


def _call_apart(call: Callable[[], None]) -> None:
    try:
        # Not by ``threading``, whose locks the main thread may hold.
        _thread.start_new_thread(call, ())
    except RuntimeError:  # there can be no more threads
        call()


def _handle(numbers: Iterable[int], call: Callable[[], None]) -> Callable[[], None]:
    if threading.current_thread() is not threading.main_thread():
        return lambda: None

    def handler(_number: int, _frame: FrameType | None) -> None:
        call()

    before = {number: signal.signal(number, handler) for number in numbers}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    return restore


@contextmanager
def stop_event(*numbers: int) -> Iterator[threading.Event]:
    """Yield an event that these signals set, SIGTERM and SIGINT by default."""
    stop = threading.Event()
    restore = call_on(*(numbers or (signal.SIGTERM, signal.SIGINT)), call=stop.set)
    try:
        yield stop
    finally:
        restore()


@contextmanager
def first_signal_calls(number: int, call: Callable[[], None]) -> Iterator[None]:
    """Call ``call`` on the first such signal, on a thread of its own, see ``call_on``.

    A second signal has its usual effect.
    """

    def once() -> None:
        restore()
        _call_apart(call)

    restore = _handle([number], once)
    try:
        yield
    finally:
        restore()


@contextmanager
def ctrl_c_waits() -> Iterator[None]:
    """Delay a KeyboardInterrupt during the block until its end.

    In a callback from C, the interrupt and the callback's result would be lost.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    came = list[bool]()
    restore = _handle([signal.SIGINT], lambda: came.append(True))
    try:
        yield
    finally:
        restore()
        if came:
            raise KeyboardInterrupt


def end_with_parent(parent: int) -> None:
    """Send this process SIGTERM once its parent, process ``parent``, has ended."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_PERIOD_S)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()
