"""Before a service is ready its kernels are compiled: a first map must not wait a minute.

They are loaded with the first map, for an idle daemon has to be small. So a process of its own
finds out whether all of them are there, compiles them where they are not, and ends.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
import time

from fasaco_edge.child_process import python_program
from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.process_memory import resident_mb

LOG = logging.getLogger(__name__)

MODULE = "fasaco_edge.daemon.compiling"
# Longer than any one stage takes on a small computer; asked for with each anew [s].
STAGE_S = 600.0
LOOK_S = 0.02
# A stage may add 250 MB to this, within what the unit may have in all (MemoryHigh=).
MOST_MB = 220.0


class KernelCompiler:
    """Begins at once, beside whatever else a start has to do."""

    def __init__(self, manager: ServiceManager) -> None:
        self._manager = manager
        self._stages = 0
        self._started = time.monotonic()
        self._process = subprocess.Popen(python_program(MODULE), stdout=subprocess.PIPE)
        threading.Thread(target=self._listen, name="compiler", daemon=True).start()

    def wait(self, stop: threading.Event) -> None:
        """Wait until all kernels are there, or ``stop`` is set.

        Raises:
            ProcessEnded: they could not be compiled.
        """
        while self._process.poll() is None and not stop.wait(LOOK_S):
            pass
        if stop.is_set():
            return
        if (code := self._process.returncode) != 0:
            raise ProcessEnded(
                f"the kernels were not compiled: the compiler ended with {code}",
                hint="is there room in the cache folder, and memory? try `fasaco-edge warmup`",
            )
        if self._stages:
            LOG.info("kernels compiled in %.0f s", time.monotonic() - self._started)

    def close(self) -> None:
        """End it: what is in a cache that is not complete, is whole."""
        self._process.kill()
        self._process.wait()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if not self._stages:
                LOG.info("compiling the kernels: this takes a minute or more, once")
            self._stages += 1
            self._manager.extend(STAGE_S)
            self._manager.status(f"compiling kernels: {line.decode(errors='replace').strip()}")


def main() -> None:
    """Compile what is not there, and print each stage before it; print nothing if all is there."""
    from fasaco_edge.kernels.cache import cache_folder, missing_from  # noqa: PLC0415

    if missing_from(cache_folder()):
        from fasaco_edge.planners.warmup import warm_up  # noqa: PLC0415

        warm_up(_begin_stage)


def _begin_stage(stage: str) -> None:
    """Tell which stage begins; where those before have left much behind, begin it afresh.

    The compiler keeps 570 MB in the end; what it has compiled is loaded in a second.
    """
    print(stage, flush=True)
    if resident_mb() > MOST_MB and sys.argv[1:] != [stage]:
        os.execv(sys.executable, python_program(MODULE, stage))


if __name__ == "__main__":
    main()
