"""Interpreters forked off a server that has imported numba, which saves 0.5 s of processor time.

A forked interpreter has imported nothing of the package, so its program decides on kernels, cache
and settings, as in a started interpreter. Commands of the package in the tests' environment are
forked off a second server, which has also loaded the kernels: this halves the time of a daemon with
a map. Do not measure start times or memory of forked processes.

``python FILE DESCRIPTOR`` is a server, with ``--kernels`` the second one. For each task it forks a
process, and sends the process id, and later the exit code, through the pipe of the task.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import gc
import os
import pickle
import runpy
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import traceback
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import NoReturn

# The package is importable from any folder, installed or not.
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
PRELOADED = ("numba", "llvmlite.binding", "msgspec", "yaml")
# Without Zenoh and Rerun: a command ends differently if these are imported.
LOADED = ("fasaco_edge.planners.compiling", "fasaco_edge.daemon.loop.mission_runner")
NUMBER = struct.Struct("i")
# Variables that a service manager sets for a daemon.
OF_MANAGER = ("NOTIFY_SOCKET", "WATCHDOG_USEC")
# Limit on a task: its words and its environment.
MOST_BYTES = 1 << 20


class Forked:
    """A forked process, with the methods of ``subprocess.Popen`` that tests use.

    Args:
        words: arguments of ``python``: "-c" and code, or "-m", a module and words.
        environment: its whole environment.
        out, err: files for its outputs. A terminal becomes its input, too, and the terminal of its
            own session.
        folder: its working folder; by default that of this process.
        umask: its umask; -1 for that of this process.
    """

    def __init__(
        self,
        words: tuple[str, ...],
        environment: Mapping[str, str],
        out: str | Path,
        err: str | Path,
        folder: str | None = None,
        umask: int = -1,
    ) -> None:
        outputs = str(out), str(err)
        task = pickle.dumps((words, dict(environment), outputs, folder or os.getcwd(), umask))
        assert len(task) < MOST_BYTES
        self._news, theirs = os.pipe()
        try:
            socket.send_fds(_server(_has_kernels(words, environment)), [task], [theirs])
        finally:
            os.close(theirs)
        self.pid = self._told()
        self.returncode: int | None = None
        self._lock = threading.Lock()

    def poll(self) -> int | None:
        """Return its exit code, or minus the number of its signal; None while it runs."""
        with self._lock:
            if self.returncode is None and select.select([self._news], [], [], 0.0)[0]:
                self.returncode = self._told()
                os.close(self._news)
            return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; return its exit code."""
        if self.poll() is None:
            select.select([self._news], [], [], timeout)
        if (code := self.poll()) is None:
            raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)

    def _told(self) -> int:
        said = os.read(self._news, NUMBER.size)
        assert said, "the server of forked processes has ended"
        number: int = NUMBER.unpack(said)[0]
        return number


def run_forked(
    words: tuple[str, ...],
    environment: Mapping[str, str],
    timeout_s: float,
    folder: str | None = None,
    umask: int = -1,
) -> tuple[int, str, str]:
    """Run a program to its end; return its exit code, and the texts of both outputs."""
    with tempfile.TemporaryDirectory() as outputs:
        out, err = Path(outputs, "out"), Path(outputs, "err")
        process = Forked(words, environment, out, err, folder, umask)
        try:
            code = process.wait(timeout_s)
        finally:
            process.kill()
            process.wait()
        # Not read as text, which would replace carriage returns.
        return code, out.read_bytes().decode(), err.read_bytes().decode()


def _settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables that may change the kernels of a process."""
    others = ("COLUMNS", "NO_COLOR", "TERM", "COLORTERM", *OF_MANAGER)
    return {k: v for k, v in environment.items() if k[:7] != "FASACO_" and k not in others}


_COMMON_SETTINGS = _settings(ENVIRONMENT)


def _has_kernels(words: tuple[str, ...], environment: Mapping[str, str]) -> bool:
    return words[:2] == ("-m", "fasaco_edge") and _settings(environment) == _COMMON_SETTINGS


@functools.cache
def _server(has_kernels: bool) -> socket.socket:
    """Return a socket to a server, which ends with this process."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_BYTES)
    with theirs:
        descriptor = theirs.fileno()
        command = [sys.executable, __file__, str(descriptor), *["--kernels"] * has_kernels]
        process = subprocess.Popen(
            command, pass_fds=(descriptor,), stdin=subprocess.DEVNULL, env=_COMMON_SETTINGS
        )

    def end() -> None:
        ours.close()
        process.wait()

    atexit.register(end)
    return ours


def _load_kernels() -> None:
    """Import what most commands import; load all kernels, and compile missing ones."""
    before = sys.path[:]
    sys.path.insert(0, os.environ["PYTHONPATH"])
    for name in LOADED:
        import_module(name)
    sys.modules[LOADED[0]].warm_up()
    sys.path[:] = before


def _serve(tasks: socket.socket) -> None:
    """Fork a process for each task, until the sender closes its socket."""
    # Garbage collection of forked processes skips present objects, whose memory stays shared.
    gc.freeze()
    woken, wakes = socket.socketpair()
    wakes.setblocking(False)
    before = signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wakes.fileno(), warn_on_full_buffer=False)
    running: dict[int, int] = {}
    while True:
        ready, _, _ = select.select([tasks, woken], [], [])
        if woken in ready:
            woken.recv(4096)
            for process in list(running):
                ended, status = os.waitpid(process, os.WNOHANG)
                if ended:
                    _tell(running.pop(process), os.waitstatus_to_exitcode(status), is_last=True)
        if tasks not in ready:
            continue
        task, news, _, _ = socket.recv_fds(tasks, MOST_BYTES, 1)
        if not task:
            return
        if (process := os.fork()) == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, before)
            for end in (tasks, woken, wakes):
                end.close()
            for descriptor in (*news, *running.values()):
                os.close(descriptor)
            _run(*pickle.loads(task))
        running[process] = news[0]
        _tell(news[0], process)


def _tell(news: int, number: int, *, is_last: bool = False) -> None:
    with contextlib.suppress(BrokenPipeError):
        os.write(news, NUMBER.pack(number))
    if is_last:
        os.close(news)


def _run(
    words: tuple[str, ...],
    environment: dict[str, str],
    outputs: tuple[str, str],
    folder: str,
    umask: int,
) -> NoReturn:
    """Run like ``python`` with these words, in this folder and environment."""
    is_terminal = outputs[0].startswith("/dev/pts/")
    if is_terminal:
        os.setsid()
    for descriptor, file in enumerate(outputs, start=1):
        # The first terminal that a session's leader opens becomes the terminal of the session.
        flags = os.O_RDWR if is_terminal else os.O_WRONLY | os.O_CREAT | os.O_APPEND
        opened = os.open(file, flags, 0o600)
        os.dup2(opened, descriptor)
        os.close(opened)
    if is_terminal:
        os.dup2(1, 0)
        # The server's streams are made for files, and would write in large blocks.
        sys.stdin = os.fdopen(0, closefd=False, encoding="utf-8")
        sys.stdout = os.fdopen(1, "w", closefd=False, encoding="utf-8")
        sys.stderr = os.fdopen(2, "w", closefd=False, encoding="utf-8", errors="backslashreplace")
    os.chdir(folder)
    if umask >= 0:
        os.umask(umask)
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None
    told = [entry for entry in environment.get("PYTHONPATH", "").split(os.pathsep) if entry]
    sys.path[:] = ["", *told, *sys.path]
    sys.modules["numba"].core.config.reload_config()
    os._exit(_ended(words))


def _ended(words: tuple[str, ...]) -> int:
    """Run a program up to the interpreter's end; return its exit code."""
    code: object = 0
    try:
        match words:
            case ("-c", program):
                exec(program, {"__name__": "__main__"})
            case ("-m", module, *rest):
                sys.argv = ["", *rest]
                runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as ended:
        code = ended.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    threading._shutdown()
    # ``os._exit`` does not run these.
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    return code if isinstance(code, int) else 1


if __name__ == "__main__":
    # A started program has neither this file's folder nor the tests' imports on its path.
    ours = {str(Path(__file__).parent), *os.environ.get("PYTHONPATH", "").split(os.pathsep)}
    sys.path[:] = [entry for entry in sys.path if entry not in ours]
    for name in PRELOADED:
        import_module(name)
    if sys.argv[2:]:
        _load_kernels()
    _serve(socket.socket(fileno=int(sys.argv[1])))
