"""Replay by time: passes the samples of a recording to the daemon's inbox and mission.

Time runs by the samples, and planning is counted in work, so that the same samples give the
same decisions, bit for bit, on any machine. A recording without a turn log shows neither in which
cycle the daemon took a sample, nor how much work a plan did. So each sample gets its own cycle,
with cycles of the daemon's clock in between, and all plans do the same work.
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
from fasaco_edge.mission.events import CommandReceived, PlanReady, PlanRequest
from fasaco_edge.mission.orders.commands import read_command
from fasaco_edge.mission.path.plan_requests import most_s
from fasaco_edge.planners.cost import SearchWork
from fasaco_edge.planners.planner import AnyOf, WorkLimit, ignore
from fasaco_edge.replay.mission_drive import MissionDrive, ReplayStep
from fasaco_edge.wire.documents.json_text import Settings, decode_json, decode_tolerant
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST, PathAttachment
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.topics import COMMAND, RECORDED_INPUTS, TURNS

# Time that the mission runs on after the last sample, to finish plans and timeouts [s].
TAIL_S = 3.0
# Samples within this time are taken in one cycle [ns]: the daemon's loop takes as long to wake up.
TOGETHER_NS = 1_000_000
INPUTS = frozenset(RECORDED_INPUTS) - {TURNS.name}
# Number of proposals of a plan, about as many as a small computer makes in 0.1 s.
PROPOSALS = 200_000


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """The recorded run of a daemon, as far as known.

    Attributes:
        config: its configuration, from its first status.
        version: its release.
        ready_ns: arrival of the first status of its mission with a map, as ``Arrival.at_ns``; None
            without such a status.
        restored_cells: number of covered cells from an earlier run, which the recording lacks.
        starts: how often the daemon was started again.
        paths: reasons of its published paths by revision, without those of a second daemon.
        path_ns: arrival of each of these paths, by the recorder's clock [ns].
    """

    config: Settings = field(default_factory=dict)
    version: str = ""
    ready_ns: int | None = None
    restored_cells: int = 0
    starts: int = 0
    paths: Mapping[int, str] = field(default_factory=dict)
    path_ns: Mapping[int, int] = field(default_factory=dict)

    def daemon_config(self) -> DaemonConfig:
        """Return the configuration in the keys and names of this release.

        Raises:
            BadConfiguration: this release does not know its settings.
        """
        # The defaults match releases from before these keys existed, which drove through cells,
        # along the axes of the map, and without a price for steps into other rooms.
        config = without_removed(renamed(self.config))[0]
        mission = config.get("mission", {})
        if isinstance(mission, Mapping):
            config["mission"] = {"by_room": "never", **mission}
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
    paths: dict[int, str] = {}
    path_ns: dict[int, int] = {}
    for arrival in samples:
        with suppress(MalformedMessage):
            if arrival.topic == PATH_DIGEST:
                about = decode_tolerant(arrival.sample.attachment, PathAttachment)
                paths.setdefault(about.revision, about.reason)
                path_ns.setdefault(about.revision, arrival.wall_ns)
            elif arrival.topic == "status":
                statuses.append((arrival, decode_tolerant(arrival.sample.payload, Status)))
    paths.pop(0, None)  # a daemon's first path, which belongs to no mission
    if not statuses:
        return RecordedRun(paths=paths, path_ns=path_ns)
    first = statuses[0][1]
    # A mission begins with a map, and has one until its end.
    ready = [arrival.at_ns for arrival, status in statuses if status.map is not None]
    begun = [status.map is not None for _, status in statuses]
    return RecordedRun(
        config=first.config,
        version=first.version,
        ready_ns=ready[0] if ready else None,
        restored_cells=first.ledger.restored_cells,
        starts=sum(before and not now for before, now in pairwise(begun)),
        paths=paths,
        path_ns=path_ns,
    )


class Replay:
    """Plays samples to a mission.

    Args:
        config: configuration of the replayed daemon.
        ready_ns: earliest beginning of its mission, see ``RecordedRun``; None to begin with the
            first map.
        work: number of proposals of each plan.

    Attributes:
        mission: the mission, for inspection between steps.
        began_ns: arrival of the first sample, by the recorder's clock [ns].
    """

    def __init__(
        self, config: DaemonConfig, ready_ns: int | None = None, work: int = PROPOSALS
    ) -> None:
        self._ready_ns = ready_ns
        self._drive = MissionDrive(config)
        self.mission = self._drive.mission
        self._budget_s, self._work = config.planner.budget_s, work
        # When the present plan is finished [s], and that plan.
        self._due: tuple[float, PlanReady] | None = None
        self._commands = 0
        self._now = 0.0
        self._base_ns = self.began_ns = 0

    def steps(self, samples: Iterable[Arrival]) -> Iterator[ReplayStep]:
        """Yield each cycle.

        Samples that are no input of the mission advance the time, too: the mission of a daemon that
        loads slowly may begin after its last input.
        """
        together: list[Arrival] = []
        last = 0.0
        for arrival in samples:
            if self._drive.began is None:
                self.began_ns = arrival.wall_ns
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
        """Return a sample's time [s] by the wall clock, which a restart does not reset."""
        return 1e-9 * (arrival.wall_ns + self._base_ns)

    def _take(self, arrivals: list[Arrival]) -> Iterator[ReplayStep]:
        """Make the cycles without samples that are due; then take samples in one cycle."""
        now = max(self._at(arrivals[0]), self._now)
        yield from self._wait(now)
        yield self._cycle(now, arrivals)

    def _wait(self, until: float) -> Iterator[ReplayStep]:
        while True:
            now = self._now + TICK_S
            if self._due is not None:
                now = min(now, max(self._due[0], self._now))
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
        may_begin = self._ready_ns is None or now >= 1e-9 * self._ready_ns
        plans = []
        if self._due is not None and self._due[0] <= now:
            plans, self._due = [self._due[1]], None
        step = drive.cycle(now, batch, commands, plans, may_begin=may_begin)
        if step.decision.plan is not None:
            self._plan(step.decision.plan, now)
        return replace(step, refused=(*step.refused, *refused))

    def _plan(self, request: PlanRequest, now: float) -> None:
        """Make a plan; it is finished after its time budget."""
        problem = request.problem
        took_s = most_s(problem) if problem.only_better else self._budget_s
        limit = AnyOf(WorkLimit(SearchWork(proposals=self._work)))
        path = self._drive.planner.plan(problem, limit, ignore)
        self._due = now + took_s, PlanReady(request.number, path, took_s)

    def _read_commands(
        self, arrivals: Sequence[Arrival]
    ) -> tuple[list[CommandReceived], list[FasacoError]]:
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
            # The daemon accepted the command, so it was allowed to forget covered cells.
            commands.append(CommandReceived(self._commands, *asked._replace(discard=True)))
        return commands, refused
