"""The daemon's life: open everything, run the loop, close everything."""

from __future__ import annotations

import logging
import signal
import threading
import time
from pathlib import Path

from fasaco_edge.bus.qos import QOS
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.daemon.about import serve_about
from fasaco_edge.daemon.commands import Commands
from fasaco_edge.daemon.compiling import compile_kernels
from fasaco_edge.daemon.config import DaemonConfig
from fasaco_edge.daemon.inbox import Inbox, make_mailbox
from fasaco_edge.daemon.ledger_writer import LedgerWriter, open_ledger
from fasaco_edge.daemon.loop import Loop
from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.daemon.outbox import Outbox
from fasaco_edge.daemon.ros_bridge import RosBridge
from fasaco_edge.daemon.supervisor import RecorderSupervisor
from fasaco_edge.daemon.turn_log import TurnLog
from fasaco_edge.daemon.vitals import Vitals

LOG = logging.getLogger(__name__)

# SIGTERM to exit takes at most two seconds; the recorder's footer comes first.
RECORDER_STOP_S = 1.2
WORKER_STOP_S = 0.4
# The ledger is written while those end; its disk is waited for so long in all, and at least
# so long once they have.
LEDGER_STOP_S, LEDGER_LEAST_S = 0.5, 0.2


def run_daemon(
    config: DaemonConfig,
    record_to: Path | None = None,
    state: Path | None = None,
    *,
    fresh: bool = False,
) -> None:
    """Serve until SIGTERM or SIGINT.

    Args:
        config: the configuration.
        record_to: folder for recordings; without it there are none.
        state: folder of the coverage ledger, in place of the configuration's.
        fresh: keep aside the ledger there is, and cover everything anew.

    Raises:
        BusUnavailable: no session could be opened.
        LedgerFileError: another process keeps this robot's ledger.
        BadConfiguration: there is no place to keep it, or a file of bus.security is missing.
        ProcessEnded: a service's kernels could not be compiled.
    """
    started = time.monotonic()
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    manager = ServiceManager()
    robot = config.robot
    folder = state or config.mission.state_folder()
    ledger = open_ledger(folder, robot.name, robot.tool_width_m, fresh=fresh)
    if manager.is_there:
        # Others are ready to answer; a service is ready to plan, see sd_notify(3).
        compile_kernels(manager, stop)
    with open_bus(config.bus.settings(config.keys().prefix, config.ros2 or None)) as bus:
        _serve(config, bus, ledger, record_to, stop, started, manager)
    LOG.info("stopped")


def _serve(
    config: DaemonConfig,
    bus: Bus,
    ledger: LedgerWriter,
    record_to: Path | None,
    stop: threading.Event,
    started: float,
    manager: ServiceManager,
) -> None:
    keys = config.keys()
    mailbox = make_mailbox()
    ros = RosBridge(bus, config.ros2, mailbox) if config.ros2 else None
    outbox = Outbox(bus, keys, ros)
    inbox = Inbox(bus, keys, mailbox, config.pose.schema, ros)
    recorder = RecorderSupervisor(config, bus, record_to) if record_to else None
    commands = Commands(bus, keys, mailbox)
    serve_about(bus, keys, config)
    turns = TurnLog(bus.publisher(keys.turns, qos=QOS["turns"]), config, ledger.restored)
    loop = Loop(config, mailbox, inbox, commands, outbox, ledger, recorder, turns, Vitals(manager))
    try:
        loop.announce()
        bus.token(keys.alive)
        LOG.info("ready after %.2f s on %s", time.monotonic() - started, keys.prefix)
        manager.ready()
        loop.run(stop)
    finally:
        manager.stopping()
        stopped = time.monotonic()
        loop.close(WORKER_STOP_S)
        if recorder is not None:
            recorder.close(RECORDER_STOP_S)
        ledger.close(max(stopped + LEDGER_STOP_S - time.monotonic(), LEDGER_LEAST_S))
