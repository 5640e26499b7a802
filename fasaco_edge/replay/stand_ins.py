"""What stands in a replay for bus, disk and planning thread.

Who plans for a replay: at once, with counted work, and as it was recorded where it was.

What a recording tells of the daemon that ran then: its configuration, its start, its paths.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise

import msgspec

from fasaco_edge.bus.arrival import PATH_DIGEST, Arrival
from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.bus.session import Bus
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.writer import LedgerWriter
from fasaco_edge.daemon.startup import Loader
from fasaco_edge.errors import BadConfiguration, FasacoError, MalformedMessage
from fasaco_edge.mission.core.events import PlanReady, PlanRequest
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.coverage.ledger import LedgerSnapshot
from fasaco_edge.planners.planner import CoveragePlanner, ignore
from fasaco_edge.planners.registry import planner_of
from fasaco_edge.planners.stopping import AnyOf, SearchWork, WorkLimit
from fasaco_edge.wire.json_text import decode_tolerant
from fasaco_edge.wire.status import PathAttachment, Settings, Status

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


# Of a plan that was not recorded: about what a small computer does in a tenth of a second.
PROPOSALS = 200_000
# A recorded plan came at most this long after its budget [s].
LATE_S = 2.0


@dataclass(frozen=True, slots=True)
class _UnderWay:
    ready: PlanReady
    due: float


class ReplayPlanner:
    """Takes the place of the daemon's planning thread.

    Args:
        planner: the daemon's.
        run: what was recorded.
        budget_s: the time its plans had [s].
        work: proposals of each plan; None for what was recorded.
    """

    def __init__(
        self, planner: CoveragePlanner, run: RecordedRun, budget_s: float, work: int | None
    ) -> None:
        self._planner = planner
        self._run = run
        self._budget_s = budget_s
        self._work = work
        self._under_way: _UnderWay | None = None

    @property
    def due(self) -> float | None:
        """When the plan under way will be there; None where there is none."""
        return self._under_way.due if self._under_way else None

    def ask(self, request: PlanRequest, revision: int, now: float) -> None:
        """Make a plan that would be published as path ``revision``."""
        recorded = self._recorded(request, revision, now)
        due = now + self._budget_s
        if recorded is not None:
            due = max(1e-9 * recorded.at_ns, now)
        limit = self._limit(recorded)
        path = self._planner.plan(request.problem, limit, ignore)
        self._under_way = _UnderWay(PlanReady(request.number, path, due - now), due)

    def take(self, now: float) -> list[PlanReady]:
        """Return the plan that is there by ``now``, if any."""
        if self._under_way is None or self._under_way.due > now:
            return []
        ready, self._under_way = self._under_way.ready, None
        return [ready]

    def _recorded(self, request: PlanRequest, revision: int, now: float) -> RecordedPath | None:
        """Return the recorded path that comes of the same request, as far as one can tell."""
        path = self._run.paths.get(revision)
        if path is None or path.work is None or path.reason != request.reason:
            return None
        after = 1e-9 * path.at_ns - now
        return path if abs(after) <= self._budget_s + LATE_S else None

    def _limit(self, recorded: RecordedPath | None) -> AnyOf:
        if self._work is not None:
            return AnyOf(WorkLimit(SearchWork(proposals=self._work)))
        if recorded is None or recorded.work is None:
            return AnyOf(WorkLimit(SearchWork(proposals=PROPOSALS)))
        # On another ground the same counts may never be met.
        most = SearchWork(proposals=2 * recorded.work.proposals + PROPOSALS)
        return AnyOf(WorkLimit(recorded.work), WorkLimit(most))


@dataclass(frozen=True, slots=True)
class RecordedPath:
    """A path that the daemon published.

    Attributes:
        at_ns: when it came to the recorder, see ``Arrival`` [ns].
        revision, reason: from its attachment.
        digest: of its points.
        work: what was done for the plan; None where no plan was needed.
    """

    at_ns: int
    revision: int
    reason: str
    digest: bytes
    work: SearchWork | None


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """What is known of the run of a daemon; without one, nothing.

    Attributes:
        config: its configuration, as its first status gave it.
        version: its release.
        ready_ns: when its mission had begun, with a map, see ``Arrival``; None if no status tells.
        restored_cells: covered cells that it took over from before; a recording has them not.
        starts: how often a daemon was started after the first.
        paths: what it published, by revision; of a second daemon, not.
    """

    config: Settings = field(default_factory=dict)
    version: str = ""
    ready_ns: int | None = None
    restored_cells: int = 0
    starts: int = 0
    paths: Mapping[int, RecordedPath] = field(default_factory=dict)

    def daemon_config(self) -> DaemonConfig:
        """Return the configuration.

        Raises:
            BadConfiguration: it is of a release whose settings this one does not know.
        """
        try:
            return msgspec.convert(self.config, DaemonConfig)
        except msgspec.ValidationError as error:
            raise BadConfiguration(
                f"recorded configuration, of release {self.version}: {error}",
                hint="give one of this release with --config",
            ) from error


def read_run(samples: Iterable[Arrival]) -> RecordedRun:
    """Return what samples, in order, tell of the daemon that ran meanwhile."""
    statuses: list[tuple[Arrival, Status]] = []
    paths: dict[int, RecordedPath] = {}
    for arrival in samples:
        with suppress(MalformedMessage):
            if arrival.topic == PATH_DIGEST and (path := _path(arrival)) is not None:
                paths.setdefault(path.revision, path)
            elif arrival.topic == "status":
                statuses.append((arrival, decode_tolerant(arrival.sample.payload, Status)))
    if not statuses:
        return RecordedRun(paths=paths)
    first = statuses[0][1]
    # The mission begins with a map, and keeps it as long as it lives.
    ready = [arrival.at_ns for arrival, status in statuses if status.map is not None]
    begun = [status.map is not None for _, status in statuses]
    return RecordedRun(
        config=first.config,
        version=first.version,
        ready_ns=ready[0] if ready else None,
        restored_cells=first.ledger.restored_cells,
        starts=sum(before and not now for before, now in pairwise(begun)),
        paths=paths,
    )


def _path(arrival: Arrival) -> RecordedPath | None:
    about = decode_tolerant(arrival.sample.attachment, PathAttachment)
    if not about.revision:
        return None
    counts = [count for count in (about.ants, about.kicks, about.proposals) if count is not None]
    return RecordedPath(
        at_ns=arrival.at_ns,
        revision=about.revision,
        reason=about.reason,
        digest=arrival.sample.payload,
        work=SearchWork(*counts) if len(counts) == 3 else None,
    )
