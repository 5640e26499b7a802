"""What stands in a replay for bus, disk and planning thread."""

from __future__ import annotations

from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.bus.session import Bus
from fasaco_edge.daemon.config import DaemonConfig
from fasaco_edge.daemon.ledger_writer import LedgerWriter
from fasaco_edge.daemon.loading import Loader
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.ledger import LedgerSnapshot
from fasaco_edge.mission.mission import Mission
from fasaco_edge.planners.planner import CoveragePlanner
from fasaco_edge.planners.table import planner_of

LOAD_S = 1.0


class SilentBus(Bus):
    """A bus on which nothing is said; knows the topics that are listened to."""

    def __init__(self) -> None:
        self.heard: set[str] = set()

    def subscribe(
        self, key: str, callback: object, latched: bool = False, history: int = 1
    ) -> Subscription:
        """Note the key's topic."""
        self.heard.add(key.rpartition("/")[2])
        return Subscription(None)


class NoDisk(LedgerWriter):
    """Keeps nothing: a replay leaves no trace.

    Args:
        restored: what the mission begins with; None for nothing covered.
    """

    def __init__(self, restored: LedgerSnapshot | None = None) -> None:
        self.restored = restored

    def put(self, ledger: LedgerSnapshot) -> None:
        """Do nothing."""

    def begin_anew(self, fault: FasacoError | None, why: str) -> None:
        """Do nothing."""


def load_mission(
    config: DaemonConfig, mailbox: Mailbox[object]
) -> tuple[Mission, Loader, CoveragePlanner]:
    """Return the mission as the daemon sets it up, what has loaded it, and its planner."""
    loader = Loader(config, mailbox)
    while (loaded := loader.poll()) is None:
        mailbox.take(LOAD_S)
    mission, worker = loaded
    worker.close(LOAD_S)
    planner = config.planner
    chosen = planner_of(planner.name, planner.colony(), planner.threads, planner.local_search)
    return mission, loader, chosen
