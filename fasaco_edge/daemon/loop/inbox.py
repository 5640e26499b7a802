"""The inbox: subscriptions to what the mission needs, and its samples decoded into events."""

from __future__ import annotations

from collections.abc import Sequence

from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.bus.session import Bus
from fasaco_edge.daemon.loop.batch import Batch, Oversized, Received, poster
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
from fasaco_edge.wire.poses import PoseDecoder

MAPS = ("map", "map_update")
# Updates without their map come in swarms; the map is asked for no more often than this [s].
ASK_FOR_MAP_S = 2.0


class Inbox:
    """Subscribes to what the mission needs, and decodes it.

    Args:
        bus, keys: where to subscribe to the native keys.
        mailbox: where samples wait for the loop.
        poses: decodes poses.
        max_pixels: of a map or an update.
        maps: further subscriptions that deliver maps.
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
        """Ask the publishers of the map for their newest one, unless that was done lately."""
        if now - self._asked_for_map_at < ASK_FOR_MAP_S:
            return
        self._asked_for_map_at = now
        for subscription in self._maps:
            subscription.ask()

    def decode(self, batch: Batch) -> tuple[list[Event], list[FasacoError]]:
        """Return the events in a batch, and the faults; a malformed sample costs itself alone.

        Of each frame the newest readable map counts. It replaces the updates of that frame that
        arrived before it, those that were lost included.
        """
        maps, faults = self._newest_maps(batch.samples)
        events = list[Event](MapReceived(grid) for grid, _ in maps.values())
        map_at = {frame: at for frame, (_, at) in maps.items()}
        faults.extend(map(_size_fault, batch.oversized))
        lost = batch.updates_lost
        for received in batch.samples:
            if received.kind == "map":
                continue
            try:
                event = self._event(received)
            except FasacoError as error:
                faults.append(_bare(error))
                continue
            if isinstance(event, PatchReceived):
                if received.at < map_at.get(event.patch.frame, float("-inf")):
                    lost = 0  # they were older still
                    continue
                if lost:
                    events.append(PatchesLost(lost))
                    lost = 0
            if event is not None:
                events.append(event)
        if lost:
            events.append(PatchesLost(lost))
        return events, faults

    def _newest_maps(
        self, samples: Sequence[Received]
    ) -> tuple[dict[str, tuple[OccupancyGrid, float]], list[FasacoError]]:
        """Return the newest readable map of each frame with its time of arrival, oldest first.

        Which frame counts is for the mission to decide, and a map may come only once.
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
        return dict(reversed(maps.items())), faults

    def _event(self, received: Received) -> Event | None:
        """Return the event in a sample; None for transforms that give no new pose."""
        kind, sample = received.kind, received.sample
        if kind == "map_update":
            return PatchReceived(decode_map_update(sample.payload, self._max_pixels))
        is_static = kind == "tf_static"
        pose = self._poses.decode(sample.payload, sample.schema, is_static=is_static)
        return None if pose is None else PoseReceived(pose)


def _bare(error: FasacoError) -> FasacoError:
    """Return the error without its traceback.

    That would hold the payload until garbage is collected: gigabytes in a flood of broken maps.
    """
    return error.with_traceback(None)


def _size_fault(dropped: Oversized) -> FasacoError:
    kind = dropped.kind.replace("_", " ")
    text = f"a {kind} of {dropped.size} bytes was dropped: it may have at most {dropped.most}"
    return MapTooLarge(text) if dropped.kind in MAPS else MalformedMessage(text)
