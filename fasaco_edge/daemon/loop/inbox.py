"""What comes in: samples off the bus, decoded into events of the mission."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.mailbox import Mailbox, Spacing
from fasaco_edge.bus.session import Bus, Sample
from fasaco_edge.daemon.memory import most_bytes, queues
from fasaco_edge.errors import FasacoError, MalformedMessage, MapTooLarge
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.core.events import (
    Event,
    MapReceived,
    PatchesLost,
    PatchReceived,
    PoseReceived,
)
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.pose_decoding import PoseDecoder

# From one map to the next that is taken in, at least [s]: a flood of maps, by mistake or malice,
# must not take a core. No mapper is that fast.
MAP_SPACING_S = 0.05
TOO_LONG = "too long"
MAPS = ("map", "map_update")
# Updates without their map come in swarms; it is asked for no more often than this [s].
ASK_FOR_MAP_S = 2.0


@dataclass(frozen=True, slots=True)
class Received:
    """A sample and when it came in [s, monotonic]."""

    sample: Sample
    at: float


@dataclass(frozen=True, slots=True)
class Oversized:
    """A sample that was let go as it came: of what kind, how long it was, and might be [bytes]."""

    kind: str
    size: int
    most: int


def make_mailbox(max_pixels: int, map_spacing_s: float = MAP_SPACING_S) -> Mailbox[object]:
    """Return the mailbox of a daemon; a replay, whose clock is another, spaces nothing.

    Poses are queued: each tells what the tool passed over. Some seconds of them
    are plenty. A map does not clear what was before it: it may be broken. An update
    patches the map before it, so it waits with that.
    """
    spacing = Spacing("map", map_spacing_s, followers=("map_update",))
    return Mailbox(queues(max_pixels), spacing, _size_of)


def _size_of(item: object) -> int:
    return item.sample.size if isinstance(item, Received) else 0


def poster(mailbox: Mailbox[object], kind: str, max_pixels: int) -> Callable[[Sample], None]:
    """Return what posts samples of a kind, on a Zenoh thread; one that is too long is let go."""
    most = most_bytes(kind, max_pixels)

    def post(sample: Sample) -> None:
        if sample.size > most:
            mailbox.post(TOO_LONG, Oversized(kind, sample.size, most))
        else:
            mailbox.post(kind, Received(sample, time.monotonic()))

    return post


class Inbox:
    """Subscribes to what the mission needs, and decodes it.

    Args:
        bus, keys: where the native keys are heard.
        mailbox: where all samples wait.
        poses: decodes poses.
        max_pixels: the most that a map, or an update, may have.
        maps: other subscriptions that maps come by.
    """

    def __init__(
        self,
        bus: Bus,
        keys: Keys,
        mailbox: Mailbox[object],
        poses: PoseDecoder,
        max_pixels: int,
        maps: Sequence[Subscription] = (),
    ) -> None:
        self._poses = poses
        self._max_pixels = max_pixels
        self._asked_for_map_at = float("-inf")
        self._maps = [
            bus.listen(keys, topics.MAP, poster(mailbox, "map", max_pixels)),
            *maps,
        ]
        for topic in (topics.MAP_UPDATE, topics.POSE):
            bus.listen(keys, topic, poster(mailbox, topic.name, max_pixels))

    def ask_for_map(self, now: float) -> None:
        """Ask whoever publishes the map, and keeps the newest for late joiners, for it."""
        if now - self._asked_for_map_at < ASK_FOR_MAP_S:
            return
        self._asked_for_map_at = now
        for subscription in self._maps:
            subscription.ask()

    def decode(
        self, items: Sequence[tuple[str, object]], patches_lost: int
    ) -> tuple[list[Event], list[FasacoError]]:
        """Return the events in ``items``; a malformed sample costs that sample alone.

        Of each frame the newest map that can be read counts, and makes the updates of that
        frame before it worthless, those that were lost too.
        """
        maps, faults = self._newest_maps(items)
        events = list[Event](map(MapReceived, (grid for grid, _ in maps.values())))
        map_at = {frame: at for frame, (_, at) in maps.items()}
        faults.extend(_fault(item) for _, item in items if isinstance(item, Oversized))
        for kind, item in items:
            if not isinstance(item, Received) or kind == "map":
                continue
            try:
                event = self._event(kind, item.sample)
            except FasacoError as error:
                faults.append(_bare(error))
                continue
            if isinstance(event, PatchReceived):
                if item.at < map_at.get(event.patch.frame, float("-inf")):
                    patches_lost = 0  # they were older still
                    continue
                if patches_lost:
                    events.append(PatchesLost(patches_lost))
                    patches_lost = 0
            if event is not None:
                events.append(event)
        if patches_lost:
            events.append(PatchesLost(patches_lost))
        return events, faults

    def _newest_maps(
        self, items: Sequence[tuple[str, object]]
    ) -> tuple[dict[str, tuple[OccupancyGrid, float]], list[FasacoError]]:
        """Return by frame the newest map that can be read, and when it came in, in that order.

        Which frame counts is for the mission to find, and a map may come only once.
        """
        maps: dict[str, tuple[OccupancyGrid, float]] = {}
        faults: list[FasacoError] = []
        for kind, item in reversed(items):
            if kind == "map" and isinstance(item, Received):
                try:
                    grid = decode_occupancy_grid(item.sample.payload, self._max_pixels)
                except FasacoError as error:
                    faults.append(_bare(error))
                else:
                    maps.setdefault(grid.frame, (grid, item.at))
        return dict(reversed(maps.items())), faults

    def _event(self, kind: str, sample: Sample) -> Event | None:
        """Return the event in a sample; None for transforms that tell no new pose."""
        if kind == "map_update":
            return PatchReceived(decode_map_update(sample.payload, self._max_pixels))
        is_static = kind == "tf_static"
        pose = self._poses.decode(sample.payload, sample.schema, is_static=is_static)
        return None if pose is None else PoseReceived(pose)


def _bare(error: FasacoError) -> FasacoError:
    """Return the error without its traceback, which would hold the payload until garbage is
    collected: of a flood of broken maps, gigabytes.
    """
    return error.with_traceback(None)


def _fault(told: Oversized) -> FasacoError:
    kind = told.kind.replace("_", " ")
    text = f"a {kind} of {told.size} bytes was let go: it may have at most {told.most}"
    return MapTooLarge(text) if told.kind in MAPS else MalformedMessage(text)
