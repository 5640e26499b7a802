"""Commands that live through a fault, and what has to be left of it.

Each is a real process of ours that is given something to do, with real sessions beside it.
"""

from __future__ import annotations

import json
import math
import os
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.daemon.ledger.codec import decode_ledger
from fasaco_edge.daemon.ledger.file import LedgerFile
from fasaco_edge.errors import LedgerFileError, UnreadableRecording
from fasaco_edge.recording.read.torn import repair_folder
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from tests.campaigns.kill_recorder import driving
from tests.campaigns.services import START_S, Service, service
from tests.daemon.test_commands import command
from tests.support.ledgers import CELL_M, Cell, contents, lane, visits_of
from tests.support.outsider import Outsider
from tests.support.processes import free_endpoint
from tests.support.recordings import bus_on_free_port, read_summary
from tests.support.rooms import begin, drive, lanes

DRIVEN, MESSAGES = 6, 60
STATE, RECORDINGS = "state", "recordings"


class WrongError(AssertionError):
    """What may not happen has happened."""


@dataclass(frozen=True)
class Scenario:
    """A command, what it lives through, and what has to be left.

    Attributes:
        prepare: lays down what it finds in the folder.
        run: runs it; returns its exit code and what it said. Raises WrongError.
        after: checks what it has left, given whether something was told. Raises WrongError.
        under: where in the folder calls may fail.
    """

    prepare: Callable[[Path], None]
    run: Callable[[Path, dict[str, str]], tuple[int | None, str]]
    after: Callable[[Path, bool], None]
    under: tuple[str, ...]


# ---- daemons ----


def _lay_ledgers(folder: Path) -> None:
    (folder / STATE).mkdir()
    file = LedgerFile(folder / STATE, "robot")
    for length in (3, 4):
        file.write(lane(length))
    _lay_config(folder)


def _lay_config(folder: Path) -> None:
    sections = {
        "bus": {"listen": [free_endpoint()]},
        "mission": {"lost_pose_s": 0.0},
        "planner": {"line": "cells"},  # what was driven is known by its cells
    }
    (folder / "etc").mkdir()
    (folder / "etc" / "config.yaml").write_text(yaml.safe_dump(sections))


def _daemon_words(folder: Path) -> list[str]:
    config = str(folder / "etc" / "config.yaml")
    return ["run", "--config", config, "--state", str(folder / STATE)]


def _endpoint(folder: Path) -> str:
    document = yaml.safe_load((folder / "etc" / "config.yaml").read_text())
    return str(document["bus"]["listen"][0])


def _give_orders(folder: Path, environment: dict[str, str]) -> tuple[int | None, str]:
    """Let a daemon without a map get commands, and end."""
    with service(folder, _daemon_words(folder), environment) as daemon:
        if _is_ready(daemon):
            with Outsider(_endpoint(folder)) as outsider:
                outsider.ask_status()
                for order in ("pause", "start", "reset", "start"):
                    if "code" in (answer := command(outsider, order)):
                        raise WrongError(f"{order} is refused: {answer}")
        return daemon.stop(), daemon.said()


def _is_ready(daemon: Service) -> bool:
    """Wait until a daemon is ready, or has ended."""
    is_ready = daemon.wait_ready(START_S)
    if not is_ready and daemon.process.poll() is None:
        raise WrongError(f"neither ready nor gone: {daemon.said()[-600:]}")
    return is_ready


def _keeps_the_four(folder: Path, is_told: bool) -> None:
    """Check that the four cells are still there, and that a daemon goes on with nothing else."""
    names = sorted(os.listdir(folder / STATE))
    kept = [_holds(folder / STATE / name) for name in names]
    if contents(lane(4)) not in kept:
        raise WrongError(f"the ledger of four cells is gone: {names}")
    if not is_told and not any(".reset-" in name for name in names):
        raise WrongError(f"it was reset, and still goes on with what was: {names}")
    _starts_again(folder, [{}, *map(visits_of, [lane(3), lane(4)] if is_told else [])])


def _holds(path: Path) -> object:
    try:
        return contents(decode_ledger(path.read_bytes(), CELL_M))
    except (OSError, LedgerFileError):
        return None


def _drive(folder: Path, environment: dict[str, str]) -> tuple[int | None, str]:
    """Let a daemon with a recorder plan, and its robot drive over some cells."""
    words = [*_daemon_words(folder), "--record", str(folder / RECORDINGS)]
    with service(folder, words, environment) as daemon:
        if _is_ready(daemon):
            with Outsider(_endpoint(folder)) as outsider:
                begin(outsider)
                drive(outsider, lanes(DRIVEN))
            if daemon.process.poll() is None:
                time.sleep(1.2)  # the recorder begins some time after the daemon
        return daemon.stop(), daemon.said()


def _knows_its_drive(folder: Path, is_told: bool) -> None:
    """Check that what was driven is kept, and nothing else."""
    found = LedgerFile(folder / STATE, "robot").load(CELL_M)
    cells = set(visits_of(found.ledger)) if found.ledger else set()
    driven = {(math.floor(y / CELL_M), math.floor(x / CELL_M)) for x, y in lanes(DRIVEN)}
    if not cells <= driven:
        raise WrongError(f"invented: {sorted(cells - driven)}")
    if not is_told and cells != driven:
        raise WrongError(f"lost without a word: {sorted(driven - cells)}")
    _starts_again(folder, [dict.fromkeys(cells, 1)])
    _recordings_read(folder, is_told)


def _starts_again(folder: Path, may_hold: Sequence[dict[Cell, int]]) -> None:
    """Start a daemon where nothing fails any more: it has to become ready.

    Args:
        may_hold: the visited cells that it may know of.
    """
    found = LedgerFile(folder / STATE, "robot").load(CELL_M)
    visits = visits_of(found.ledger) if found.ledger else {}
    if visits not in may_hold:
        raise WrongError(f"what it goes on with was never so: {visits}")
    with service(folder, _daemon_words(folder)) as daemon:
        if not daemon.wait_ready():
            raise WrongError(f"does not start again: {daemon.said()[-600:]}")
        if (code := daemon.stop()) != 0:
            raise WrongError(f"started again, it ends with {code}: {daemon.said()[-600:]}")


# ---- recorders ----


def _record(folder: Path, environment: dict[str, str]) -> tuple[int | None, str]:
    """Let a recorder write for a while."""
    with bus_on_free_port() as (bus, endpoint), driving(bus):
        words = ["record", "--out", str(folder / RECORDINGS), "--connect", endpoint]
        enough = threading.Event()
        bus.listen(Keys(), topics.RECORDER, lambda sample: _hear(sample, enough))
        with service(folder, words, environment) as recorder:
            deadline = time.monotonic() + START_S
            while recorder.process.poll() is None and not enough.wait(0.05):
                if time.monotonic() > deadline:
                    raise WrongError(f"says nothing: {recorder.said()[-600:]}")
            return recorder.stop(), recorder.said()


def _hear(sample: Sample, enough: threading.Event) -> None:
    if json.loads(sample.payload)["messages"] >= MESSAGES:
        enough.set()


def _recordings_read(folder: Path, is_told: bool) -> None:
    """Check that what was recorded can be read, once the next recorder has looked it through."""
    recordings = folder / RECORDINGS
    rows = 0
    if recordings.is_dir():
        repair_folder(recordings)
        for part in recordings.glob("*.rrd"):
            try:
                rows += sum(read_summary(part).rows.values())
            except UnreadableRecording as error:
                if part.stat().st_size and not is_told:
                    raise WrongError(f"not readable after its repair: {error}") from error
    if not is_told and not rows:
        raise WrongError(f"nothing recorded, and not a word: {sorted(os.listdir(folder))}")


SCENARIOS = {
    "orders": Scenario(_lay_ledgers, _give_orders, _keeps_the_four, (STATE, "etc")),
    "mission": Scenario(_lay_config, _drive, _knows_its_drive, (STATE, RECORDINGS)),
    "recorder": Scenario(lambda _: None, _record, _recordings_read, (RECORDINGS,)),
}
