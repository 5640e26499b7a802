"""The kernel compiler: a process that compiles missing kernels before a service is ready.

A first map must not wait a minute for them. An idle daemon stays small and loads kernels with the
first map: so a separate process compiles them, and ends. Kernels that are damaged, or that others
could have written, count as missing; without a cache they are compiled on demand.
"""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
import time

from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.host.processes import python_program, resident_mb
from fasaco_edge.kernels import release
from fasaco_edge.kernels.cache import cache_folder, missing_from

LOG = logging.getLogger(__name__)

MODULE = "fasaco_edge.daemon.compiling"
# Startup time requested for each stage; longer than any takes on a small computer [s].
STAGE_S = 600.0
LOOK_S = 0.02
# Beside the daemon's 45 MB within the unit's limit (MemoryHigh=); a seventh of it are pages of
# libraries, which other processes have, too, or the system takes back.
MOST_MB = 240.0
# Fifteen, as measured; a disk that keeps no file as it was written does not go on for ever.
MOST_RESTARTS = 300
# Lines that the process prints: one of these words, a tab and a text.
REASON, STAGE, WARNING = "reason", "stage", "warning"


class KernelCompiler:
    """Starts the process at once, in parallel with the rest of the startup."""

    def __init__(self, manager: ServiceManager) -> None:
        self._manager = manager
        self._stages = 0
        self._started = time.monotonic()
        self._process: subprocess.Popen[str] | None = None
        folder = cache_folder()
        if folder is None:
            return  # already logged; what it compiled would be lost
        if folder == release.FOLDER:
            return
        self._process = subprocess.Popen(
            python_program(MODULE),
            env=os.environ | {"NUMBA_CACHE_DIR": str(folder)},
            stdout=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
        )
        self._listener = threading.Thread(target=self._listen, name="compiler", daemon=True)
        self._listener.start()

    def wait(self, stop: threading.Event) -> None:
        """Wait until all kernels are there, or ``stop`` is set.

        Raises:
            ProcessEnded: the compiler failed, or was killed.
        """
        if self._process is None:
            return
        while self._process.poll() is None and not stop.wait(LOOK_S):
            pass
        if stop.is_set():
            return
        if (code := self._process.returncode) != 0:
            raise ProcessEnded(
                f"the kernels were not compiled: the compiler {_ended(code)}",
                hint="check that 300 MB of memory are free, then try `fasaco-edge warmup`",
            )
        if self._stages:
            LOG.info("kernels compiled in %.0f s", time.monotonic() - self._started)

    def close(self) -> None:
        """End the process; kernels cached so far are complete."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def _listen(self) -> None:
        assert self._process is not None
        assert self._process.stdout is not None
        for line in self._process.stdout:
            word, _, text = line.rstrip("\n").partition("\t")
            if word == REASON:
                LOG.info("compiling the kernels, for a minute or more: %s", text)
            elif word == WARNING:
                LOG.warning("%s", text)
            elif word == STAGE:
                self._stages += 1
                self._manager.extend(STAGE_S)
                self._manager.status(f"compiling kernels: {text}")


def _ended(code: int) -> str:
    """Return how a process ended, in words."""
    if code >= 0:
        return f"ended with {code}"
    name = signal.Signals(-code).name
    return f"was killed by {name}" + (", probably out of memory" if name == "SIGKILL" else "")


def main() -> None:
    """Compile missing kernels and print why; print nothing if none is missing."""
    logging.basicConfig(level=logging.WARNING, handlers=[_ToDaemon()])
    folder = cache_folder()
    if folder is None:
        return
    restarts = int(sys.argv[1]) if sys.argv[1:] else 0
    if why := missing_from(folder):
        if not restarts:
            _say(REASON, why)
        from fasaco_edge.kernels.code_files import after_each_kept  # noqa: PLC0415
        from fasaco_edge.planners.warmup import warm_up  # noqa: PLC0415

        after_each_kept(lambda: _stay_small(restarts))
        warm_up(_begin_stage)


class _ToDaemon(logging.Handler):
    """Passes log messages on to the daemon."""

    def emit(self, record: logging.LogRecord) -> None:
        _say(WARNING, record.getMessage())


def _say(word: str, text: str) -> None:
    print(f"{word}\t{' '.join(text.splitlines())}", flush=True)


def _begin_stage(stage: str) -> None:
    """Report a stage; end where what is compiled cannot be kept."""
    from fasaco_edge.kernels.code_files import FAULTS  # noqa: PLC0415

    if FAULTS.failure:
        # Kernels compiled here would be lost: the daemon compiles them with its first map.
        sys.exit(0)
    _say(STAGE, stage)


def _stay_small(restarts: int) -> None:
    """Restart this process where its memory has grown too much.

    The compiler would keep 930 MB in the end. Called after each file that is written: the next
    process loads it and goes on from there.
    """
    if resident_mb() > MOST_MB and restarts < MOST_RESTARTS:
        os.execv(sys.executable, python_program(MODULE, str(restarts + 1)))


if __name__ == "__main__":
    main()
