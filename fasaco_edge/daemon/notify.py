"""Notifications to the service manager by the protocol of sd_notify(3), one datagram each."""

from __future__ import annotations

import logging
import os
import socket
import time
from collections.abc import MutableMapping

from fasaco_edge.text import one_line

LOG = logging.getLogger(__name__)

# How long to wait for a busy manager, as at boot, with messages sent only once [s]; no other
# message may delay the loop.
PATIENCE_S = 1.0
# `systemctl status` shows one line [characters].
MOST_SAID = 500


class ServiceManager:
    """The manager that started this process; outside of a service there is none.

    Attributes:
        is_there: whether there is one.
        watchdog_s: silence after which it takes this process for hung [s]; 0 for no limit.
    """

    def __init__(self, environ: MutableMapping[str, str] = os.environ) -> None:
        """Take the variables out of ``environ``, so that no child process uses them."""
        address = environ.pop("NOTIFY_SOCKET", "")
        silence_us = environ.pop("WATCHDOG_USEC", "0")
        is_ours = environ.pop("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        # "@" stands for the NUL of a name in the abstract namespace.
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self.is_there = bool(address)
        self.watchdog_s = int(silence_us) / 1e6 if is_ours and silence_us.isdecimal() else 0.0
        self._status = ""

    def ready(self) -> None:
        """Report that the service is up, or that its configuration is reloaded."""
        self._send("READY=1", PATIENCE_S)

    def status(self, text: str) -> None:
        """Set the status line of the service."""
        if text != self._status and self._send("STATUS=" + one_line(text, MOST_SAID)):
            self._status = text

    def alive(self) -> None:
        """Report progress; due within each ``watchdog_s``."""
        self._send("WATCHDOG=1")

    def extend(self, seconds: float) -> None:
        """Ask for so much more time [s] to start."""
        self._send(f"EXTEND_TIMEOUT_USEC={seconds * 1e6:.0f}")

    def reloading(self) -> None:
        """Report that the configuration is being reloaded; ``ready`` follows."""
        now_us = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
        self._send(f"RELOADING=1\nMONOTONIC_USEC={now_us}", PATIENCE_S)

    def stopping(self) -> None:
        """Report that the service ends."""
        self._send("STOPPING=1")

    def _send(self, text: str, patience_s: float = 0.0) -> bool:
        """Send a datagram; tell whether it was taken."""
        if not self.is_there:
            return True
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as out:
                out.settimeout(patience_s)
                out.sendto(text.encode(), self._address)
        except OSError as error:
            word = text.partition("=")[0]
            LOG.warning(
                "the service manager does not accept %s: %s",
                word,
                error,
                extra={"event": "unheard"},
            )
            return False
        return True
