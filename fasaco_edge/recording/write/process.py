"""The recording process: what all recorders share, from the repair of a folder to the exit code."""

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
        """Log a fault from before the recording began."""

    def listen(self) -> None:
        """Subscribe to all that is recorded."""

    def step(self, timeout_s: float) -> None:
        """Record what arrives within ``timeout_s`` [s], and what is due."""

    def end(self) -> bool:
        """Write what waits, and the footer; False if the disk fails."""

    @property
    def hangs(self) -> bool:
        """Whether rerun would hang when the interpreter exits."""


@dataclass(frozen=True, slots=True)
class Output:
    """Where and how a recorder writes.

    Attributes:
        folder: for the recordings; made if missing.
        budget: of the disk.
    """

    folder: Path
    budget: DiskBudget

    def begin(self, name: str, blueprint: rrb.Blueprint) -> Recording:
        """Begin a recording, named after a robot or fleet, and return it."""
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
        writer: writes it.
        clock: its timeline.
        began_ns, began: when it began: since the epoch [ns], and as text, UTC.
    """

    writer: RecordingWriter
    clock: RunClock
    began_ns: int
    began: str


def record(
    folder: Path, bus_settings: BusSettings, recorder_on: Callable[[Bus], BusRecorder]
) -> int:
    """Record until SIGTERM or SIGINT; return the process's exit code.

    If the disk fails, the process exits here (``os._exit``): rerun would block a normal exit.

    Args:
        folder: of the recordings; interrupted recordings are repaired first.
        bus_settings: how to join the bus.
        recorder_on: makes the recorder.

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
        # All recoverable data are saved; rerun would block a normal exit for ever.
        os._exit(code)
    return code


def _repaired(folder: Path) -> list[str]:
    """Repair the recordings in a folder; return what was repaired, in words."""
    try:
        repairs = repair_folder(folder)
    except OSError as error:
        raise BadConfiguration(
            f"cannot record into {folder}: {error}", hint="name a folder that may be written to"
        ) from error
    return [str(repair) for repair in repairs]
