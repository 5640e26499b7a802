"""The daemon as a service: open everything, run the loop, close everything."""

from __future__ import annotations

import logging
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fasaco_edge.bus.session import Bus, join, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.cautions import log_cautions
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.fleet_wing import receiver_of, sender_of
from fasaco_edge.daemon.ledger.rooms_file import RoomsFile, RoomsKeeper
from fasaco_edge.daemon.ledger.writer import LedgerKeeper, LedgerWriter, open_ledger
from fasaco_edge.daemon.loop.answers import Commands, serve_about
from fasaco_edge.daemon.loop.inbox import Inbox, make_mailbox
from fasaco_edge.daemon.loop.loop import Loop, Ports
from fasaco_edge.daemon.loop.outbox import Outbox
from fasaco_edge.daemon.loop.turn_log import TurnLog
from fasaco_edge.daemon.mask_topic import MaskTopic
from fasaco_edge.daemon.memory import has_default_sizes, limited_to_memory, needed_bytes
from fasaco_edge.daemon.name_claim import NameClaim
from fasaco_edge.daemon.notify import ServiceManager, Watchdog
from fasaco_edge.daemon.reload import Reload
from fasaco_edge.daemon.ros_bridge import RosBridge
from fasaco_edge.daemon.supervisor import RecorderSupervisor
from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.durable import file_in_place_of
from fasaco_edge.host.processes import (
    call_on,
    end_within,
    memory_limit,
    release_unused,
    return_soon,
)
from fasaco_edge.planners.compiling import REASON, STAGE, CompilerProcess
from fasaco_edge.wire import topics

if TYPE_CHECKING:
    from fasaco_edge.daemon.metrics import MetricsServer

LOG = logging.getLogger(__name__)

# Time for the recorder's footer after SIGTERM, so that the daemon exits within two seconds [s];
# limit for a recorder that still works, as on a slow computer, below the unit's ``TimeoutStopSec=``
# [s].
RECORDER_STOP_S, RECORDER_LONGEST_S = 1.2, 6.0
WORKER_STOP_S = 0.4
# Timeout of the last write of the ledger, made while the other processes end [s]; least time for it
# after they have ended [s].
LEDGER_STOP_S, LEDGER_LEAST_S = 0.5, 0.2
# Time after which a blocked process exits by itself [s]: SIGKILL, after the 10 s of
# ``TimeoutStopSec=``, would leave no trace of the cause.
END_S = 9.0
# Thread switch interval of the interpreter [s]. Zenoh's threads call back with each sample; with
# Python's default of 5 ms the loop would wait for them several times in a cycle.
SWITCH_S = 0.0005


def run_daemon(
    config: DaemonConfig,
    record_to: Path | None,
    state: Path | None,
    *,
    fresh: bool,
    read: Callable[[], DaemonConfig],
) -> None:
    """Serve until SIGTERM or SIGINT.

    Args:
        record_to: folder for recordings; None for no recordings.
        state: folder of the coverage ledger; None for the configured one.
        fresh: set the ledger aside, and cover everything again.
        read: reads the configuration again on SIGHUP from a service manager.

    Raises:
        BusUnavailable: no session could be opened.
        LedgerFileError: another process writes this robot's ledger.
        BadConfiguration: there is no folder for the ledger, a file lies in place of a folder, or a
            file of bus.security is missing.
        ProcessEnded: a service's kernels could not be compiled.
    """
    started = time.monotonic()
    sys.setswitchinterval(SWITCH_S)
    # Otherwise every thread would keep the memory of its largest map: 430 MB resident, not 250.
    return_soon()
    stop = threading.Event()

    def end() -> None:
        if not stop.is_set():  # each call would restart the timeout
            end_within(END_S)
        stop.set()

    call_on(signal.SIGTERM, signal.SIGINT, call=end)
    manager = ServiceManager()
    reload = Reload(read, manager)
    if manager.is_present:
        # Without a service manager, SIGHUP comes from a closed terminal and ends the process.
        call_on(signal.SIGHUP, call=reload.asked.set)
    config = _afforded(config)
    compiler = KernelCompiler(manager) if manager.is_present else None
    try:
        folder = state or config.mission.state_folder()
        _check_folder("keep progress in", folder)
        if record_to is not None:
            _check_folder("record into", record_to)
        ledger = open_ledger(folder, config.robot.name, config.cell_m, fresh=fresh)
        if compiler is not None:
            compiler.wait(stop)
        config.bus.security.warn_of_certificate()
        log_cautions(config)
        settings = config.bus.settings(config.keys().prefix, config.ros2 or None)
        bus = _joined(settings, stop, manager)
        if bus is None:
            return
        with bus:
            rooms = RoomsKeeper(RoomsFile(folder, config.robot.name))
            _serve(config, bus, (ledger, rooms), record_to, stop, started, manager, reload)
    finally:
        if compiler is not None:
            compiler.close()
    LOG.info("stopped", extra={"event": "stopped"})


def _check_folder(purpose: str, folder: Path) -> None:
    """Check that no file lies in place of a folder: waiting does not mend that.

    Raises:
        BadConfiguration: one does.
    """
    if (file := file_in_place_of(folder)) is not None:
        raise BadConfiguration(f"cannot {purpose} {folder}: {file} is not a folder")


def _joined(settings: BusSettings, stop: threading.Event, manager: ServiceManager) -> Bus | None:
    """Return an open session; a client waits for its router; None if stopped meanwhile.

    Raises:
        BusUnavailable: no session can be opened, even by waiting.
    """
    # Waiting does not help against wrong addresses or credentials of this daemon.
    if settings.mode != "client" or settings.secured:
        return open_bus(settings)

    def report_wait(is_first: bool) -> None:
        if is_first:
            # The manager would end a service that does not report that it is ready.
            manager.ready()
            manager.status(f"waiting for the bus at {', '.join(settings.connect)}")
        manager.alive()

    return join(settings, stop, report_wait)


def _metrics_of(config: DaemonConfig) -> MetricsServer | None:
    """Return the server of metrics; None if none is configured."""
    if (address := config.metrics.address()) is None:
        return None
    from fasaco_edge.daemon.metrics import serve_metrics  # noqa: PLC0415

    return serve_metrics(address)


def _afforded(config: DaemonConfig) -> DaemonConfig:
    """Return the configuration, with smaller maps if memory is limited; log that."""
    limit = memory_limit()
    smaller = limited_to_memory(config, limit)
    if limit is not None and smaller is not config:
        # If the configuration gives no sizes, maps may be as large as the memory allows.
        LOG.log(
            logging.INFO if has_default_sizes(config) else logging.WARNING,
            "memory is limited to %.0f MB, maps of map.max_pixels %d and map.max_lattice_cells %d "
            "may need %.0f MB: they are reduced to %d and %d",
            limit / 1e6,
            config.map.max_pixels,
            config.map.max_lattice_cells,
            needed_bytes(config) / 1e6,
            smaller.map.max_pixels,
            smaller.map.max_lattice_cells,
            extra={"event": "memory_limit"},
        )
    return smaller


def _serve(
    config: DaemonConfig,
    bus: Bus,
    kept: tuple[LedgerWriter, RoomsKeeper],
    record_to: Path | None,
    stop: threading.Event,
    started: float,
    manager: ServiceManager,
    reload: Reload,
) -> None:
    keys, (ledger, rooms) = config.keys(), kept
    max_pixels = config.map.max_pixels
    mailbox = make_mailbox(max_pixels)
    ros = RosBridge(bus, config.ros2, mailbox, max_pixels) if config.ros2 else None
    if config.mission.keep_out_topic:
        reload.mask = MaskTopic(bus, config, ros, lambda: mailbox.post("reloaded", None))
    recorder = RecorderSupervisor(config, bus, record_to) if record_to else None
    metrics = _metrics_of(config)
    ports = Ports(
        mailbox=mailbox,
        inbox=Inbox(
            bus,
            keys,
            mailbox,
            config.poses(),
            max_pixels,
            [ros.map] if ros else [],
            receiver_of(config),
        ),
        commands=Commands(bus, keys, mailbox, ros.commands if ros else {}),
        outbox=Outbox(bus, keys, ros),
        fleet=sender_of(config, bus),
        turns=TurnLog(bus.advertise(keys, topics.TURNS), config, ledger.restored, rooms.restored),
        claim=NameClaim(bus, keys),
        watchdog=Watchdog(manager),
        reload=reload,
        recorder=recorder,
        metrics=metrics,
    )
    keeper = LedgerKeeper(ledger, config.cell_m, autostart=config.mission.autostart)
    loop = Loop(config, ports, keeper, rooms)
    serve_about(bus, keys, lambda: loop.config)
    try:
        loop.announce()
        bus.token(keys.of(topics.ALIVE))
        seconds = time.monotonic() - started
        LOG.info("ready after %.2f s on %s", seconds, keys.prefix, extra={"event": "ready"})
        if not stop.is_set():
            manager.ready()
        release_unused()
        loop.run(stop)
    finally:
        manager.stopping()
        if metrics is not None:
            metrics.close()
        stopped = time.monotonic()
        loop.close(WORKER_STOP_S)
        if recorder is not None:
            recorder.close(RECORDER_STOP_S, RECORDER_LONGEST_S)
        rooms.close(LEDGER_LEAST_S)
        ledger.disk.close(max(stopped + LEDGER_STOP_S - time.monotonic(), LEDGER_LEAST_S))


# Startup time requested for each stage; longer than any stage takes on a small computer [s].
STAGE_S = 600.0
# Period of checks whether compilation has ended [s].
LOOK_S = 0.02


class KernelCompiler:
    """Compiles the kernels before the service reports that it is ready, in a separate process.

    The first map must not wait minutes for compilation. The process is separate so that an idle
    daemon stays small: it loads the kernels with the first map.
    """

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
