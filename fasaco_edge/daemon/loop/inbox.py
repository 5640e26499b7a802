"""The inbox: the mission's subscriptions, and the samples of a cycle decoded into events."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.mailbox import Mailbox, Spacing
from fasaco_edge.bus.one_publisher import OnePublisher, ReturningMaps
from fasaco_edge.bus.queries import Question
from fasaco_edge.bus.session import Bus
from fasaco_edge.daemon.loop.answers import error_reply
from fasaco_edge.daemon.memory import most_bytes, queues
from fasaco_edge.errors import CommandError, FasacoError, MalformedMessage, MapTooLarge
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.events import (
    BatteryReceived,
    Event,
    FollowerBlocked,
    MapReceived,
    PatchesLost,
    PatchReceived,
    PlanBroken,
    PlanReady,
    PoseReceived,
    PriorityReceived,
)
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.blocked import decode_blocked
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_PRIORITY_BYTES
from fasaco_edge.wire.messages.battery import decode_battery
from fasaco_edge.wire.messages.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import TF_MESSAGE

if TYPE_CHECKING:
    from fasaco_edge.daemon.fleet_wing import MessagesOfOthers

MAPS = ("map", "map_update")
# Inputs that only one publisher may send, and their plurals in reports.
PLURALS = {
    topics.MAP: "maps",
    topics.POSE: "poses",
    topics.BATTERY: "charges of the battery",
    topics.PRIORITY: "priorities",
}
# Least period of queries for the map, as updates without their map come in bursts [s].
ASK_FOR_MAP_S = 2.0
# Least period of maps, shorter than any mapper's: a flood of maps must not take a core [s].
MAP_SPACING_S = 0.05
# Limit on the poses of a cycle, as other samples must not wait for a thousand poses. A command
# waits for all earlier poses: floor swept before a reset must not count after the reset.
MOST_POSES = 32
# Limit on the commands of a cycle, as an order of a hundred zones takes as long as a map.
MOST_COMMANDS = 1


@dataclass(frozen=True, slots=True)
class Received:
    """A sample, its kind (a queue of the mailbox), and its time of arrival [s, monotonic]."""

    kind: str
    sample: Sample
    at: float


@dataclass(frozen=True, slots=True)
class Oversized:
    """A sample dropped on arrival: its kind, its size and the limit [bytes]."""

    kind: str
    size: int
    most: int


@dataclass(slots=True)
class CycleInput:
    """The input of one cycle.

    Attributes:
        samples: samples, each kind in order of arrival.
        oversized: samples dropped for their size.
        questions: commands that wait for a reply.
        plans: results of the planning thread, good or not.
        updates_lost: number of map updates dropped by the full queue.
    """

    samples: list[Received] = field(default_factory=list)
    oversized: list[Oversized] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)
    plans: list[PlanReady | PlanBroken] = field(default_factory=list)
    updates_lost: int = 0


def take_batch(mailbox: Mailbox[object], timeout_s: float) -> CycleInput:
    """Wait up to ``timeout_s`` [s] for an arrival, and take all arrivals.

    Raises:
        BaseException: posted by a thread that failed.
    """
    batch = CycleInput()
    for _, item in mailbox.take(timeout_s):
        match item:
            case Received():
                batch.samples.append(item)
            case Question():
                batch.questions.append(item)
            case PlanReady() | PlanBroken():
                batch.plans.append(item)
            case Oversized():
                batch.oversized.append(item)
            case BaseException():
                raise item
    batch.updates_lost = mailbox.take_lost("map_update")
    return batch


def make_mailbox(
    max_pixels: int, map_spacing_s: float = MAP_SPACING_S, most_poses: float = MOST_POSES
) -> Mailbox[object]:
    """Return the mailbox of a daemon; a replay, with another clock, sets no rate limits.

    Poses are queued for some seconds, as each adds to the swept floor. A map does not replace the
    previous map in the queue, as the new one may be malformed. An update waits with the map that it
    changes.
    """
    spacing = Spacing("map", map_spacing_s, followers=("map_update",))
    bounds = queues(max_pixels)
    bounds["pose"] = replace(bounds["pose"], at_once=most_poses)
    bounds["command"] = replace(bounds["command"], at_once=MOST_COMMANDS, after="pose")
    return Mailbox(bounds, spacing, _size_of, _refuse)


def _refuse(lost: object) -> None:
    """Reject a command dropped by a full queue, so that its client does not take it as done."""
    if isinstance(lost, Question):
        error = CommandError("too many commands at once: not carried out", hint="ask again")
        lost.answer(error_reply(error))


def _size_of(item: object) -> int:
    return item.sample.size if isinstance(item, Received) else 0


def poster(mailbox: Mailbox[object], kind: str, max_pixels: int) -> Callable[[Sample], None]:
    """Return a callback that posts samples of a kind on a Zenoh thread; drops oversized samples."""
    most = most_bytes(kind, max_pixels)

    def post(sample: Sample) -> None:
        if sample.size > most:
            mailbox.post("oversized", Oversized(kind, sample.size, most))
        else:
            mailbox.post(kind, Received(kind, sample, time.monotonic()))

    return post


class Inbox:
    """Subscribes to the mission's inputs, and decodes them.

    Args:
        bus, keys: the session and the native keys.
        mailbox: holds samples for the loop.
        poses: decodes poses.
        max_pixels: largest map or update [pixels].
        maps: further subscriptions that deliver maps.
        fleet: receives messages of a fleet's other robots; None without a fleet.

    Attributes:
        refused: why the newest sample of a kind was refused, by kind.
    """

    def __init__(
        self,
        bus: Bus,
        keys: Keys,
        mailbox: Mailbox[object],
        poses: PoseDecoder,
        max_pixels: int,
        maps: Sequence[Subscription] = (),
        fleet: MessagesOfOthers | None = None,
    ) -> None:
        self._poses = poses
        self._max_pixels = max_pixels
        self._fleet = fleet
        self._asked_for_map_at = float("-inf")
        self._maps = [bus.listen(keys, topics.MAP, poster(mailbox, "map", max_pixels)), *maps]
        others = topics.MAP_UPDATE, topics.POSE, topics.BATTERY, topics.PRIORITY, topics.BLOCKED
        for topic in others:
            bus.listen(keys, topic, poster(mailbox, topic.name, max_pixels))
        if fleet is not None:
            fleet.listen(bus, poster(mailbox, topics.FLEET.name, max_pixels))
        self._returning = ReturningMaps()
        self.refused: dict[str, str] = {}
        self._publishers = {
            topic.name: OnePublisher(many, topic.one_publisher_s, bus)
            for topic, many in PLURALS.items()
        }

    def drop_second_publishers(self, batch: CycleInput, now: float) -> None:
        """Drop the samples in a batch that ``bus.one_publisher`` refuses."""
        batch.samples = [one for one in batch.samples if self._counts(one)]
        if self._publishers[topics.MAP.name].takes_over(now):
            for subscription in self._maps:
                subscription.ask()

    def conflicts(self, now: float) -> list[str]:
        """Return which inputs come from two publishers."""
        found = [each.conflict(now) for each in self._publishers.values()]
        return [text for text in (*found, self._returning.conflict(now)) if text]

    def _counts(self, received: Received) -> bool:
        kind, sample = received.kind, received.sample
        if kind == topics.MAP_UPDATE.name:
            return not self._publishers[topics.MAP.name].refuses(sample.sender)
        # Each link of a chain of transforms has a publisher of its own.
        if kind not in self._publishers or sample.schema == TF_MESSAGE:
            return True
        return self._publishers[kind].takes(sample.sender, received.at)

    def ask_for_map(self, now: float) -> None:
        """Query the publishers of maps for the newest map, with a rate limit."""
        if now - self._asked_for_map_at < ASK_FOR_MAP_S:
            return
        self._asked_for_map_at = now
        for subscription in self._maps:
            subscription.ask()

    def decode(
        self, batch: CycleInput, *, has_mission: bool = True
    ) -> tuple[list[Event], list[FasacoError]]:
        """Return the events in a batch, and the faults; a malformed sample affects no other.

        In each frame the newest readable map counts; it replaces earlier updates of that frame,
        also lost ones. Messages of a fleet wait in their receiver until there is a mission, as the
        turn log contains them only from then on.
        """
        maps, faults = self._newest_maps(batch.samples)
        maps = {each: one for each, one in maps.items() if self._returning.takes(*one)}
        events = list[Event](MapReceived(grid) for grid, _ in maps.values())
        map_at = {frame: at for frame, (_, at) in maps.items()}
        faults.extend(map(_size_fault, batch.oversized))
        self.refused |= {each.kind: str(_size_fault(each)) for each in batch.oversized}
        lost = batch.updates_lost
        for received in batch.samples:
            is_early = received.kind == topics.FLEET.name and not has_mission
            if received.kind == "map" or is_early:
                continue
            try:
                event = self._event(received)
            except FasacoError as error:
                faults.append(_bare(error))
                self.refused[received.kind] = str(error)
                continue
            self.refused.pop(received.kind, None)
            if isinstance(event, PatchReceived):
                if received.at < map_at.get(event.patch.frame, float("-inf")):
                    lost = 0  # lost updates were older than the map
                    continue
                if lost:
                    events.append(PatchesLost(lost))
                    lost = 0
            if event is not None:
                events.append(event)
        if lost:
            events.append(PatchesLost(lost))
        if self._fleet is not None:
            faults += self._fleet.take_faults()
        return events, faults

    def _newest_maps(
        self, samples: Sequence[Received]
    ) -> tuple[dict[str, tuple[OccupancyGrid, float]], list[FasacoError]]:
        """Return the newest readable map of each frame with its time of arrival, oldest first.

        The mission decides which frame counts, and a map may be sent only once.
        """
        maps: dict[str, tuple[OccupancyGrid, float]] = {}
        faults: list[FasacoError] = []
        for received in reversed(samples):
            if received.kind != "map":
                continue
            try:
                grid = decode_occupancy_grid(received.sample.payload, self._max_pixels)
            except FasacoError as error:
                faults.append(_bare(error))
            else:
                maps.setdefault(grid.frame, (grid, received.at))
        if maps:
            self.refused.pop("map", None)
        elif faults:
            self.refused["map"] = str(faults[0])
        return dict(reversed(maps.items())), faults

    def _event(self, received: Received) -> Event | None:
        """Return the event in a sample; None for transforms without a new pose."""
        kind, sample = received.kind, received.sample
        if kind == topics.FLEET.name:
            return self._fleet.event(sample) if self._fleet else None
        if kind == "map_update":
            return PatchReceived(decode_map_update(sample.payload, self._max_pixels))
        if kind == topics.BLOCKED.name:
            return blocked_of(sample.payload)
        if kind == topics.PRIORITY.name:
            return PriorityReceived(decode_occupancy_grid(sample.payload, MAX_PRIORITY_BYTES))
        if kind == "battery":
            state = decode_battery(sample.payload)
            return BatteryReceived(state.level, state.power, state.stamp_ns)
        is_static = kind == "tf_static"
        pose = self._poses.decode(sample.payload, sample.schema, is_static=is_static)
        return None if pose is None else PoseReceived(pose)


def blocked_of(payload: bytes) -> FollowerBlocked:
    """Return the event in a follower's report.

    Raises:
        MalformedMessage: it is not valid.
    """
    one = decode_blocked(payload)
    return FollowerBlocked(
        one.revision, one.detail, one.held_s, one.frame, one.x, one.y, one.points
    )


def _bare(error: FasacoError) -> FasacoError:
    """Return the error without its traceback.

    The traceback would keep the payload until garbage collection: gigabytes in a flood of malformed
    maps.
    """
    return error.with_traceback(None)


def _size_fault(dropped: Oversized) -> FasacoError:
    kind = dropped.kind.replace("_", " ")
    was = f"a {kind} message of {dropped.size} bytes was dropped"
    text = f"{was}: it may have at most {dropped.most}"
    if dropped.kind in MAPS:
        hint = "publish the map with larger pixels, or raise map.max_pixels"
        return MapTooLarge(text, hint=hint)
    return MalformedMessage(text, hint="publish smaller messages; is another type sent there?")
