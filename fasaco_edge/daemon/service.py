"""The daemon's life: open everything, run the loop, close everything."""

from __future__ import annotations

import logging
import signal
import threading
import time
from pathlib import Path

from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.daemon.config import DaemonConfig
from fasaco_edge.daemon.inbox import Inbox, make_mailbox
from fasaco_edge.daemon.loop import Loop
from fasaco_edge.daemon.outbox import Outbox
from fasaco_edge.daemon.supervisor import RecorderSupervisor

LOG = logging.getLogger(__name__)

# SIGTERM to exit takes at most two seconds; the recorder's footer comes first.
RECORDER_STOP_S = 1.2
WORKER_STOP_S = 0.4


def run_daemon(config: DaemonConfig, record_to: Path | None = None) -> None:
    """Serve until SIGTERM or SIGINT.

    Raises:
        BusUnavailable: no session could be opened.
    """
    started = time.monotonic()
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    with open_bus(config.bus.settings()) as bus:
        _serve(config, bus, record_to, stop, started)
    LOG.info("stopped")


def _serve(
    config: DaemonConfig, bus: Bus, record_to: Path | None, stop: threading.Event, started: float
) -> None:
    keys = config.keys()
    mailbox = make_mailbox()
    outbox = Outbox(bus, keys)
    inbox = Inbox(bus, keys, mailbox, config.pose.schema)
    recorder = RecorderSupervisor(config, bus, record_to) if record_to else None
    loop = Loop(config, mailbox, inbox, outbox, recorder)
    try:
        loop.announce()
        bus.token(keys.alive)
        LOG.info("ready after %.2f s on %s", time.monotonic() - started, keys.prefix)
        loop.run(stop)
    finally:
        loop.close(WORKER_STOP_S)
        if recorder is not None:
            recorder.close(RECORDER_STOP_S)
