"""Before a service is ready its kernels are compiled: a first map must not wait a minute.

They are loaded with the first map, for an idle daemon has to be small. That they are there is
found out without loading them; where they are not, a process of its own compiles them and ends.
"""

from __future__ import annotations

import logging
import subprocess
import sys
import threading
import time

from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.kernels.cache import cache_folder, is_complete

LOG = logging.getLogger(__name__)

# Longer than any one stage takes on a small computer; asked for with each anew [s].
STAGE_S = 300.0
LOOK_S = 0.05


def compile_kernels(manager: ServiceManager, stop: threading.Event) -> None:
    """Compile the kernels if they are not; return early where ``stop`` is set.

    Raises:
        ProcessEnded: they could not be compiled.
    """
    folder = cache_folder()
    if is_complete(folder):
        return
    LOG.info("compiling the kernels into %s: this takes a minute, once", folder)
    started = time.monotonic()
    manager.extend(STAGE_S)
    manager.status("compiling kernels")
    process = subprocess.Popen(
        [sys.executable, "-m", "fasaco_edge.daemon.compiling"], stdout=subprocess.PIPE
    )
    try:
        threading.Thread(target=_pass_on, args=(process, manager), daemon=True).start()
        while process.poll() is None and not stop.wait(LOOK_S):
            pass
    finally:
        process.kill()  # half a cache is no harm: what is in it, is whole
        process.wait()
    if stop.is_set():
        return
    if process.returncode != 0:
        raise ProcessEnded(
            f"the kernels were not compiled: the compiler ended with {process.returncode}",
            hint=f"is there room in {folder}, and memory? try `fasaco-edge warmup`",
        )
    LOG.info("kernels compiled in %.0f s", time.monotonic() - started)


def _pass_on(process: subprocess.Popen[bytes], manager: ServiceManager) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        manager.extend(STAGE_S)
        manager.status(f"compiling kernels: {line.decode(errors='replace').strip()}")


def main() -> None:
    """Compile all there is, and print each stage before it."""
    from fasaco_edge.planners.warmup import warm_up  # noqa: PLC0415

    warm_up(lambda stage: print(stage, flush=True))


if __name__ == "__main__":
    main()
