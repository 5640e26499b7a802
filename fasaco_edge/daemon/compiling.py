"""Compilation of the kernels before a service reports that it is ready, in a separate process.

The first map must not wait minutes for compilation. The process is separate so that an idle daemon
stays small: it loads the kernels with the first map.
"""

from __future__ import annotations

import logging
import threading
import time

from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.planners.compiling import REASON, STAGE, CompilerProcess

LOG = logging.getLogger(__name__)

# Startup time requested for each stage; longer than any stage takes on a small computer [s].
STAGE_S = 600.0
# Period of checks whether compilation has ended [s].
LOOK_S = 0.02


class KernelCompiler:
    """Starts the process at once, in parallel with the rest of the startup."""

    def __init__(self, manager: ServiceManager) -> None:
        self._manager = manager
        self._stages = 0
        self._started = time.monotonic()
        self._process = CompilerProcess.start()
        if self._process is not None:
            threading.Thread(target=self._listen, name="compiler", daemon=True).start()

    def wait(self, stop: threading.Event) -> None:
        """Wait until all kernels are compiled, or ``stop`` is set.

        Raises:
            ProcessEnded: the compiler failed, or was killed.
        """
        if self._process is None:
            return
        while not self._process.has_ended() and not stop.wait(LOOK_S):
            pass
        if stop.is_set():
            return
        self._process.check()
        if self._stages:
            LOG.info("kernels compiled in %.0f s", time.monotonic() - self._started)

    def close(self) -> None:
        """End the process; the stages that it has compiled stay."""
        if self._process is not None:
            self._process.close()

    def _listen(self) -> None:
        assert self._process is not None
        for word, text in self._process.lines():
            if word == REASON:
                LOG.info("compiling the kernels, which takes minutes: %s", text)
            elif word == STAGE:
                self._stages += 1
                self._manager.extend(STAGE_S)
                self._manager.status(f"compiling kernels: {text}")
