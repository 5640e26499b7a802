"""Replay by time: the samples of a recording through the daemon's inbox and mission.

Time is that of the samples, and planning is counted in work, so that the same samples give the
same decisions, bit for bit, on any machine. A recording without a turn log does not show in which
cycle the daemon took a sample, nor how much work each plan had time for. So each sample gets its
own cycle, with cycles of the daemon's clock in between; a plan whose path was recorded gets the
same work, and arrives at the same time. For an ordinary mission, the decisions are those of the
recording.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise

import msgspec

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.reading import renamed, without_removed
from fasaco_edge.daemon.loop.inbox import Received, take_batch
from fasaco_edge.daemon.loop.loop import TICK_S
from fasaco_edge.errors import BadConfiguration, FasacoError, MalformedMessage
from fasaco_edge.mission.core.events import (
    BETTER,
    SPARE,
    CommandReceived,
    PathUpdate,
    PlanReady,
    PlanRequest,
)
from fasaco_edge.mission.core.spare_time import most_s
from fasaco_edge.mission.orders.order import read_command
from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.planner import AnyOf, CoveragePlanner, WorkLimit, ignore
from fasaco_edge.replay.mission_drive import MissionDrive, ReplayStep
from fasaco_edge.wire.documents.json_text import decode_json, decode_tolerant
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST, PathAttachment, digest
from fasaco_edge.wire.documents.settings import Settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.topics import COMMAND, RECORDED_INPUTS, TURNS

# How long the mission runs after the last sample [s], of an input or not: plans finish, timeouts
# expire.
TAIL_S = 3.0
# Samples this close together are taken in one cycle: the daemon's loop needs about as long to
# wake up.
TOGETHER_NS = 1_000_000
INPUTS = frozenset(RECORDED_INPUTS) - {TURNS.name}
# Proposals of a plan that was not recorded: about what a small computer makes in 0.1 s.
PROPOSALS = 200_000
# A recorded plan came at most this long after its budget [s].
LATE_S = 2.0


@dataclass(frozen=True, slots=True)
class RecordedPath:
    """A path that the daemon published.

    Attributes:
        at_ns: when it came to the recorder, see ``Arrival`` [ns].
        revision, reason: from its attachment.
        digest: of its points.
        work: search work of the plan; None if no plan was needed.
    """

    at_ns: int
    revision: int
    reason: str
    digest: bytes
    work: SearchWork | None


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """The recorded run of a daemon, as far as known.

    Attributes:
        config: its configuration, from its first status.
        version: its release.
        ready_ns: when its mission had begun, with a map, see ``Arrival``; None if no status shows
            that.
        restored_cells: number of covered cells that it took over from an earlier run; the recording
            does not have them.
        starts: how often a daemon was started after the first.
        paths: its published paths by revision, without those of a second daemon.
    """

    config: Settings = field(default_factory=dict)
    version: str = ""
    ready_ns: int | None = None
    restored_cells: int = 0
    starts: int = 0
    paths: Mapping[int, RecordedPath] = field(default_factory=dict)

    @property
    def own_planner(self) -> str:
        """The user's planner of an earlier release's daemon, which made its plans; "" for none."""
        planner = self.config.get("planner")
        own = planner.get("own") if isinstance(planner, Mapping) else None
        return own if isinstance(own, str) else ""

    def daemon_config(self) -> DaemonConfig:
        """Return the configuration in the keys and names of this release.

        Raises:
            BadConfiguration: it is of a release whose settings this one does not know.
        """
        # Releases without lines drove through cells; those without lattice rotation, along the
        # axes.
        config = without_removed(renamed(self.config))
        planner = config.get("planner", {})
        if isinstance(planner, Mapping):
            config["planner"] = {"line": "cells", "align": "axes", **planner}
        try:
            return msgspec.convert(config, DaemonConfig)
        except msgspec.ValidationError as error:
            raise BadConfiguration(
                f"recorded configuration, of release {self.version}: {error}",
                hint="give one of this release with --config",
            ) from error


def read_run(samples: Iterable[Arrival]) -> RecordedRun:
    """Return the daemon's run, from samples in order."""
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


class Replay:
    """Plays samples to a mission.

    Args:
        config: configuration of the replayed daemon.
        run: the recorded run.
        work: proposals of each plan; None for the recorded work.

    Attributes:
        mission: the mission, to be looked at between steps.
        plans: the planner.
    """

    def __init__(
        self, config: DaemonConfig, run: RecordedRun | None = None, work: int | None = None
    ) -> None:
        self._run = run or RecordedRun()
        self._drive = MissionDrive(config)
        self.mission = self._drive.mission
        self.plans = ReplayPlanner(self._drive.planner, self._run, config.planner.budget_s, work)
        self._commands = 0
        self._now = 0.0
        self._base_ns = 0

    def steps(self, samples: Iterable[Arrival]) -> Iterator[ReplayStep]:
        """Yield each cycle; samples that are no input of the mission only advance the time. If a
        daemon loads slowly, its mission begins, and its path comes, after its last input.
        """
        together: list[Arrival] = []
        last = 0.0
        for arrival in samples:
            if self._drive.began is None:
                self._base_ns = arrival.at_ns - arrival.wall_ns
                self._drive.began = self._now = 1e-9 * arrival.at_ns
            last = max(last, self._at(arrival))
            if arrival.topic not in INPUTS:
                continue
            if together and arrival.wall_ns - together[0].wall_ns > TOGETHER_NS:
                yield from self._take(together)
                together = []
            together.append(arrival)
        if together:
            yield from self._take(together)
        yield from self._wait(max(last, self._now) + TAIL_S)

    def _at(self, arrival: Arrival) -> float:
        """Return when a sample came [s]: by the wall clock, which runs on over a restart."""
        return 1e-9 * (arrival.wall_ns + self._base_ns)

    def _take(self, arrivals: list[Arrival]) -> Iterator[ReplayStep]:
        """Take samples in one cycle, after the cycles without samples before it."""
        now = max(self._at(arrivals[0]), self._now)
        yield from self._wait(now)
        yield self._cycle(now, arrivals)

    def _wait(self, until: float) -> Iterator[ReplayStep]:
        """Make the cycles that come without a sample."""
        while True:
            due = self.plans.due
            tick = self._now + TICK_S
            now = tick if due is None else min(tick, max(due, self._now))
            if now >= until:
                return
            yield self._cycle(now)

    def _cycle(self, now: float, arrivals: Sequence[Arrival] = ()) -> ReplayStep:
        self._now = now
        drive, mailbox = self._drive, self._drive.mailbox
        for arrival in arrivals:
            if arrival.topic != COMMAND.name:
                mailbox.post(arrival.topic, Received(arrival.topic, arrival.sample, now))
        commands, refused = self._read_commands(arrivals)
        batch = take_batch(mailbox, 0.0)
        ready_ns = self._run.ready_ns
        may_begin = ready_ns is None or now >= 1e-9 * ready_ns
        plans = self.plans.take(now)
        step = drive.cycle(now, batch, commands, plans, may_begin=may_begin)
        decision = step.decision
        if decision.plan is not None:
            self.plans.ask(decision.plan, self.mission.route.revision + 1, now)
        return replace(
            step,
            refused=(*step.refused, *refused),
            as_recorded=None if decision.path is None else self._as_recorded(decision.path),
        )

    def _read_commands(
        self, arrivals: Sequence[Arrival]
    ) -> tuple[list[CommandReceived], list[FasacoError]]:
        """Return the commands that the recorded daemon took, and the errors of malformed ones."""
        commands, refused = list[CommandReceived](), list[FasacoError]()
        for arrival in arrivals:
            if arrival.topic != COMMAND.name:
                continue
            try:
                asked = read_command(decode_json(arrival.sample.payload))
            except FasacoError as error:
                refused.append(error)
                continue
            self._commands += 1
            # The daemon accepted it, so it was allowed to forget what was covered.
            commands.append(CommandReceived(self._commands, *asked._replace(discard=True)))
        return commands, refused

    def _as_recorded(self, update: PathUpdate) -> bool | None:
        recorded = self._run.paths.get(update.revision)
        mission = self.mission
        if recorded is None or mission.lattice is None:
            return None
        xy = mission.lattice.centres(update.cells) if update.xy is None else update.xy
        return digest(xy.tobytes()) == recorded.digest


class ReplayPlanner:
    """Takes the place of the daemon's planning thread.

    Args:
        planner: the daemon's.
        run: the recorded run.
        budget_s: the time its plans had [s].
        work: proposals of each plan; None for the recorded work.

    Attributes:
        due: when the plan under way is finished [s]; None without one.
    """

    def __init__(
        self, planner: CoveragePlanner, run: RecordedRun, budget_s: float, work: int | None
    ) -> None:
        self._planner = planner
        self._run = run
        self._budget_s = budget_s
        self._work = work
        self.due: float | None = None
        self._ready: PlanReady | None = None

    def ask(self, request: PlanRequest, revision: int, now: float) -> None:
        """Make a plan that would be published as path ``revision``."""
        recorded = self._recorded(request, revision, now)
        problem = request.problem
        took_s = most_s(problem) if problem.only_better else self._budget_s
        due = now + took_s if recorded is None else max(1e-9 * recorded.at_ns, now)
        path = self._planner.plan(problem, self._limit(recorded), ignore)
        self.due, self._ready = due, PlanReady(request.number, path, due - now)

    def take(self, now: float) -> list[PlanReady]:
        """Return the plan that is finished by ``now``, if any."""
        if self._ready is None or self.due is None or self.due > now:
            return []
        ready, self.due, self._ready = self._ready, None, None
        return [ready]

    def _recorded(self, request: PlanRequest, revision: int, now: float) -> RecordedPath | None:
        """Return the recorded path of probably the same request, by its number, reason and time."""
        path = self._run.paths.get(revision)
        reason = BETTER if request.reason == SPARE else request.reason
        if path is None or path.work is None or path.reason != reason:
            return None
        after = 1e-9 * path.at_ns - now
        return path if abs(after) <= self._budget_s + LATE_S else None

    def _limit(self, recorded: RecordedPath | None) -> AnyOf:
        if self._work is not None or recorded is None or recorded.work is None:
            proposals = PROPOSALS if self._work is None else self._work
            return AnyOf(WorkLimit(SearchWork(proposals=proposals)))
        # On another ground the same counts of work may never be reached.
        most = SearchWork(proposals=2 * recorded.work.proposals + PROPOSALS)
        return AnyOf(WorkLimit(recorded.work), WorkLimit(most))
