"""What the loop tells the service manager: what it does, and that it gets on."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

from fasaco_edge.daemon.notify import ServiceManager

if TYPE_CHECKING:
    from fasaco_edge.daemon.worker import PlanningWorker

LOG = logging.getLogger(__name__)

# Of the silence that is allowed: a turn may come late, and a word get lost.
SHARE = 0.25


class Vitals:
    """Feeds the watchdog from the loop itself, and only while the planning thread gets on, too.

    A thread of its own that fed it would do so beside a loop that hangs.

    Attributes:
        remark: what else is to be known of the service; "" for nothing.
    """

    def __init__(self, manager: ServiceManager) -> None:
        self.remark = ""
        self._manager = manager
        self._period_s = SHARE * manager.watchdog_s
        self._fed_at = float("-inf")
        self._progress = -1
        self._state = ""

    def beat(self, worker: PlanningWorker | None, now: float) -> None:
        """Feed the watchdog if that is due; before there is a worker, nothing can hang but us."""
        if not self._period_s or now - self._fed_at < self._period_s:
            return
        if worker is not None:
            if worker.progress == self._progress:
                return
            self._progress = worker.progress
        self._fed_at = now
        self._manager.alive()

    def tell(self, status: dict[str, Any]) -> None:
        """Say in a line what a status says; log it where the state is another."""
        if status["state"] != self._state:
            self._state = status["state"]
            LOG.info("%s", _doing(status), extra={"event": "state", "state": self._state})
        remark = f"; {self.remark}" if self.remark else ""
        self._manager.status(status_line(status) + remark)


def status_line(status: dict[str, Any]) -> str:
    """Return a status as a line: its state and why, how much is covered, what is wrong."""
    parts = [_doing(status)]
    if coverage := status["coverage"]:
        area = f"{coverage['covered_m2']:.0f} of {coverage['to_cover_m2']:.0f} m2"
        parts.append(f"{100 * coverage['fraction']:.0f} % covered, {area}")
    if path := status["path"]:
        parts.append(f"path {path['revision']} with {path['remaining_steps']} steps to go")
    if fault := status["ledger"].get("fault"):
        parts.append(str(fault))
    return "; ".join(parts)


def _doing(status: dict[str, Any]) -> str:
    return f"{status['state']}: {status['reason']}" if status["reason"] else str(status["state"])
