"""Reload of the configuration on SIGHUP; an invalid file is refused as a whole.

A file whose mask cannot be read is invalid. A mask received as a message is not part of the file:
if it cannot be read, the last mask stays in force, and the file is accepted.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path

from msgspec import structs

from fasaco_edge.config.cautions import log_cautions
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.loading import load_config, with_mask
from fasaco_edge.daemon.mask_topic import MaskTopic
from fasaco_edge.daemon.memory import mask_bytes
from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.errors import BadConfiguration, DocumentError
from fasaco_edge.host.processes import memory_limit

LOG = logging.getLogger(__name__)

# Sections and keys that can change in a running daemon.
CHANGEABLE = frozenset(
    {
        "planner",
        "map",
        "mission",
        "robot.speed_m_s",
        "robot.quarter_turn_s",
        "robot.turn_deg_s",
        "robot.turn_deg_s2",
        "robot.acceleration_m_s2",
        "robot.steered_deg",
    }
)
# Keys of these sections that need a restart all the same: they decide the ledger's cells or the
# shares of memory, or were used to open session or ledger, or to start another process.
FIXED = frozenset(
    {
        "planner.line",
        "map.max_pixels",
        "map.max_lattice_cells",
        "mission.autostart",
        "mission.keep_out_topic",
        "mission.state_dir",
    }
)


def read_config(path: Path | None) -> DaemonConfig:
    """Return a daemon's configuration, with the content of the mask's file.

    Raises:
        BadConfiguration: it is invalid, or its keep-out mask does not fit the memory.
    """
    config = load_config(path)
    return with_mask(config, path, mask_bytes(config, memory_limit()))


class Reload:
    """Reads the configuration again on request, on its own thread, as a mask may take seconds.

    Attributes:
        asked: set by the signal.
        mask: the keep-out mask received as a message; None for none.
    """

    def __init__(self, read: Callable[[], DaemonConfig], manager: ServiceManager) -> None:
        self.asked = threading.Event()
        self.mask: MaskTopic | None = None
        self._read = read
        self._manager = manager
        self._reading: Future[tuple[DaemonConfig, list[BadConfiguration]]] | None = None

    @property
    def is_reading(self) -> bool:
        """Whether reading is under way, or its result has not been taken."""
        return self._reading is not None

    @property
    def is_read(self) -> bool:
        """Whether there is a result to take."""
        return self._reading is not None and self._reading.done()

    @property
    def is_wanted(self) -> bool:
        """Whether the signal or a mask has arrived."""
        return self.asked.is_set() or (self.mask is not None and self.mask.has_change)

    def begin(self, running: DaemonConfig, ended: Callable[[], None]) -> None:
        """Begin to read; ``ended`` is called afterwards, on the reading thread.

        For a mask alone the file is not read.
        """
        read = self._read if self.asked.is_set() else lambda: running
        self.asked.clear()
        self._manager.reloading()
        reading = self._reading = Future()

        def run() -> None:
            try:
                config = read()
                reading.set_result(self.mask.added_to(config) if self.mask else (config, []))
            except BaseException as error:
                reading.set_exception(error)
            ended()

        threading.Thread(target=run, name="reload", daemon=True).start()

    def take(self, running: DaemonConfig) -> tuple[DaemonConfig, Sequence[DocumentError]]:
        """Return the running configuration with the changeable values of the file.

        Also return why the file or the newest mask is refused; a refused file changes no value.
        """
        assert self._reading is not None
        reading, self._reading = self._reading, None
        try:
            written, faults = reading.result()
        except BadConfiguration as error:
            text = "configuration refused, the previous one stays in force: %s (%s)"
            for fault in (refused := [error, *error.rest]):
                extra = {"event": "reload_refused", "code": fault.code}
                LOG.error(text, fault, fault.hint, extra=extra)
            return running, refused
        for fault in faults:
            extra = {"event": "mask_refused", "code": fault.code}
            LOG.error("keep-out mask refused: %s (%s)", fault, fault.hint, extra=extra)
        changed = changed_keys(running, written)
        for_restart = [key for key in changed if not is_changeable(key)]
        if for_restart:
            keys = ", ".join(for_restart)
            LOG.warning("%s: needs a restart", keys, extra={"event": "reload_needs_restart"})
        taken = ", ".join(key for key in changed if is_changeable(key))
        LOG.info("configuration read again: %s", taken or "no change", extra={"event": "reload"})
        config = with_changeable(running, written)
        if taken:
            log_cautions(config)
        return config, faults

    def done(self) -> None:
        """Report that the new configuration is in force."""
        self._manager.ready()


def is_changeable(key: str) -> bool:
    """Return whether the value can change in a running daemon."""
    if key in FIXED:
        return False
    return key in CHANGEABLE or key.partition(".")[0] in CHANGEABLE


def changed_keys(before: DaemonConfig, after: DaemonConfig) -> list[str]:
    """Return the keys whose values differ, each as ``section.key``."""
    first, second = _flat(before), _flat(after)
    return sorted(key for key in first if first[key] != second[key])


def with_changeable(running: DaemonConfig, written: DaemonConfig) -> DaemonConfig:
    """Return ``running`` with the values of ``written`` for each changeable key."""
    for key in filter(is_changeable, changed_keys(running, written)):
        section, name = key.split(".")
        taken = {name: getattr(getattr(written, section), name)}
        changed = structs.replace(getattr(running, section), **taken)
        running = structs.replace(running, **{section: changed})
    return running


def _flat(config: DaemonConfig) -> dict[str, object]:
    """Return the values by ``section.key``; an optional section counts as one value."""
    sections = structs.asdict(config)
    left_out = ("fleet", "battery", "scan", "ros2")
    flat: dict[str, object] = {name: sections.pop(name) for name in left_out}
    for name, section in sections.items():
        flat |= {f"{name}.{key}": value for key, value in structs.asdict(section).items()}
    return flat
