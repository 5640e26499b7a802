"""The recording process, common to the recorders of robots and fleets."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.processes import release_unused, return_soon, stop_event
from fasaco_edge.recording.read.repair import repair_folder
from fasaco_edge.recording.sdk import rrb
from fasaco_edge.recording.write.inbox import RunClock
from fasaco_edge.recording.write.quota import DiskBudget, next_run
from fasaco_edge.recording.write.writer import RecordingWriter

TAKE_TIMEOUT_S = 0.1
EXIT_STALLED = 1


class BusRecorder(Protocol):
    """Connects the bus to a writer."""

    def note(self, line: str) -> None:
        """Log a fault in the recording."""

    def listen(self) -> None:
        """Subscribe to all recorded topics."""

    def step(self, timeout_s: float) -> None:
        """Record samples that arrive within ``timeout_s`` [s], and drawings that are due."""

    def end(self) -> bool:
        """Write waiting samples and the footer; False if the disk fails."""

    @property
    def hangs(self) -> bool:
        """Whether Rerun would hang when the interpreter exits."""


@dataclass(frozen=True, slots=True)
class Output:
    """Where and how a recorder writes.

    Attributes:
        folder: folder of the recordings; created if missing.
        budget: limits of disk space.
    """

    folder: Path
    budget: DiskBudget

    def begin(self, name: str, blueprint: rrb.Blueprint) -> Recording:
        """Begin a recording of a robot or fleet; ``name``: its name."""
        clock = RunClock()
        began_ns = clock.now_ns()
        began = datetime.fromtimestamp(began_ns / 1e9, UTC)
        run = next_run(self.folder, name, began)
        writer = RecordingWriter(self.folder, run, self.budget, blueprint)
        writer.at(began_ns)
        return Recording(writer, clock, began_ns, f"{began:%Y-%m-%d %H:%M:%S}")


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording that has begun.

    Attributes:
        writer: writer of its parts.
        clock: clock of its timeline.
        began_ns, began: its beginning: since the epoch [ns], and as text, UTC.
    """

    writer: RecordingWriter
    clock: RunClock
    began_ns: int
    began: str


def record(
    folder: Path, bus_settings: BusSettings, recorder_on: Callable[[Bus], BusRecorder]
) -> int:
    """Record until SIGTERM or SIGINT; return the process's exit code.

    If the disk fails, the process exits here (``os._exit``): Rerun would block a normal exit.

    Args:
        folder: folder of the recordings; torn recordings are repaired first.
        bus_settings: settings of the bus session.
        recorder_on: returns the recorder on a bus.

    Raises:
        BusUnavailable: nothing listens at the endpoints.
        BadConfiguration: the folder cannot be made or written to.
    """
    return_soon()
    repairs = _repaired(folder)
    with stop_event() as stop, open_bus(bus_settings) as bus:
        recorder = recorder_on(bus)
        for line in repairs:
            recorder.note(line)
        recorder.listen()
        release_unused()
        while not stop.is_set():
            recorder.step(TAKE_TIMEOUT_S)
        code = 0 if recorder.end() else EXIT_STALLED
    if recorder.hangs:
        # All recoverable data are saved.
        os._exit(code)
    return code


def _repaired(folder: Path) -> list[str]:
    """Repair the recordings in a folder; return a line of text for each repair."""
    try:
        repairs = repair_folder(folder)
    except OSError as error:
        raise BadConfiguration(
            f"cannot record into {folder}: {error}", hint="name a folder that may be written to"
        ) from error
    return [str(repair) for repair in repairs]
