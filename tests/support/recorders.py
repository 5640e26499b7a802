"""Recorder processes, started and ended as a supervisor would."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fasaco_edge.bus.session import Bus, BusSettings, Sample, open_bus
from fasaco_edge.wire.keys import Keys

RUN = """
import json, pathlib, sys
from fasaco_edge.bus.session import BusSettings
from fasaco_edge.recording.write.recorder import run_recorder
from fasaco_edge.recording.write.settings import RecorderSettings
told = json.loads(sys.argv[1])
bus = BusSettings(connect=(told.pop("endpoint"),))
sys.exit(run_recorder(RecorderSettings(pathlib.Path(told.pop("out")), bus=bus, **told)))
"""
TIMEOUT_S = 120.0


@dataclass
class Recorder:
    """A recorder process, and what it says about itself."""

    process: subprocess.Popen[str]
    reports: list[dict[str, Any]] = field(default_factory=list)

    def hear(self, sample: Sample) -> None:
        """Take in a report, on a Zenoh thread."""
        self.reports.append(json.loads(sample.payload))

    def wait_until(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Return the first report from now on for which ``holds``."""
        deadline = time.monotonic() + TIMEOUT_S
        seen = max(len(self.reports) - 1, 0)
        while time.monotonic() < deadline:
            for report in self.reports[seen:]:
                if holds(report):
                    return report
            assert self.process.poll() is None, self.process.stderr and self.process.stderr.read()
            time.sleep(0.02)
        raise AssertionError(f"never happened; last report: {self.reports[-1:]}")

    def written(self, messages: int) -> dict[str, Any]:
        """Wait until so many messages were taken."""
        return self.wait_until(lambda report: report["messages"] >= messages)


@contextmanager
def bus_on_free_port() -> Iterator[tuple[Bus, str]]:
    """Open a bus as the daemon does, and say where."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with open_bus(BusSettings(mode="router", connect=(), listen=(endpoint,))) as bus:
        yield bus, endpoint


@contextmanager
def recorder_process(bus: Bus, endpoint: str, out: Path, **settings: Any) -> Iterator[Recorder]:
    """Run a recorder until the end of the block, or until the test ends it."""
    told = json.dumps({"endpoint": endpoint, "out": str(out)} | settings)
    process = subprocess.Popen([sys.executable, "-c", RUN, told], stderr=subprocess.PIPE, text=True)
    recorder = Recorder(process)
    try:
        bus.subscribe(Keys().recorder, recorder.hear, latched=True)
        recorder.wait_until(lambda report: report["pid"] == process.pid)
        yield recorder
    finally:
        process.kill()
        process.communicate()
