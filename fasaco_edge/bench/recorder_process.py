"""A real recorder beside a daemon, as a process of its own."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fasaco_edge.bench.daemon_process import (
    LOOK_EVERY_S,
    PROGRAM,
    START_TIMEOUT_S,
    STOP_TIMEOUT_S,
    DaemonProcess,
)
from fasaco_edge.bus.session import Bus
from fasaco_edge.errors import ProcessEnded


@contextmanager
def recorder_beside(daemon: DaemonProcess, bus: Bus) -> Iterator[None]:
    """Record what ``daemon`` does, from the moment the recorder listens to the end of the block.

    Raises:
        ProcessEnded: it ended by itself, or does not listen in time.
    """
    with tempfile.TemporaryDirectory(prefix="fasaco-bench-") as folder:
        command = [*PROGRAM, "record", "--out", folder, "--connect", daemon.endpoint]
        with Path(folder, "recorder.log").open("w+b") as log:
            process = subprocess.Popen(
                [*command, "--with-parent", str(os.getpid())], stdout=log, stderr=log
            )
            try:
                _wait_alive(process, daemon, bus, Path(log.name))
                yield
            finally:
                process.terminate()
                try:
                    process.wait(STOP_TIMEOUT_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def _wait_alive(
    process: subprocess.Popen[bytes], daemon: DaemonProcess, bus: Bus, log: Path
) -> None:
    deadline = time.monotonic() + START_TIMEOUT_S
    while not bus.alive(f"{daemon.keys.recorder}/alive"):
        if process.poll() is not None or time.monotonic() > deadline:
            said = log.read_text(errors="replace").splitlines()[-5:]
            raise ProcessEnded("the recorder does not listen:\n  " + "\n  ".join(said))
        time.sleep(LOOK_EVERY_S)
