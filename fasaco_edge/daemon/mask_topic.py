"""Keep-out mask received as a message, from Nav2 or another program.

The mask replaces the file ``mission.keep_out_mask`` in the configuration in force, as by a reload,
so that recordings and replays contain it. Reading a mask takes as much memory as a map; maps wait
meanwhile.

A mask is valid in its frame. The newest mask in another frame than the map's is kept, in case the
map's frame changes to it. The mission waits until there is a mask in the map's frame.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from msgspec import structs

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.one_publisher import OnePublisher
from fasaco_edge.bus.session import Bus
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.memory import most_bytes
from fasaco_edge.daemon.ros_bridge import RosBridge
from fasaco_edge.errors import BadConfiguration, FasacoError
from fasaco_edge.mission.orders.mask import inline_grid
from fasaco_edge.wire import topics
from fasaco_edge.wire.messages.maps import decode_occupancy_grid

# Limit on the masks that wait to be read, each of another publisher; only one publisher counts.
MOST_WAITING = 2


class MaskTopic:
    """Subscribes to masks, and puts the mask in the map's frame into a configuration.

    ``arrived`` is called for each mask, on a Zenoh thread.

    Attributes:
        map_frame: frame of the map; "" while it is unknown, and masks wait.
    """

    def __init__(
        self, bus: Bus, config: DaemonConfig, ros: RosBridge | None, arrived: Callable[[], None]
    ) -> None:
        self._max_pixels = config.map.max_pixels
        self._occupied_at_least = config.map.occupied_at_least
        self._arrived = arrived
        self.map_frame = ""
        self._lock = threading.Lock()
        # The newest mask of each publisher with its time of arrival [s, monotonic]; and the mask to
        # read.
        self._waiting: dict[str, tuple[Sample, float]] = {}
        self._newest: Sample | None = None
        self._publisher = OnePublisher("keep-out masks", topics.KEEP_OUT_MASK.one_publisher_s, bus)
        # The newest mask of each frame, inline, the newest last; and the mask in force.
        self._masks: dict[str, str] = {}
        self._in_force = ""
        self._subscriptions = [bus.listen(config.keys(), topics.KEEP_OUT_MASK, self._take)]
        if ros is not None:
            self._subscriptions.append(ros.subscribe_mask(self._take))

    def choose(self, now: float) -> None:
        """Take the newest mask of the publisher that counts; ``now``: monotonic [s]."""
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        # A thread that holds the lock must not call Zenoh, whose threads wait for the lock.
        takes = self._publisher.takes
        if taken := [sample for sender, (sample, at) in waiting.items() if takes(sender, at)]:
            with self._lock:
                self._newest = taken[-1]
        if self._publisher.takes_over(now):
            for subscription in self._subscriptions:
                subscription.ask()

    def conflicts(self, now: float) -> list[str]:
        """Return the text of a conflict of two publishers, if there is one."""
        text = self._publisher.conflict(now)
        return [text] if text else []

    @property
    def has_change(self) -> bool:
        """Whether there is a mask to read, or the map's frame is now that of another mask."""
        kept = self._masks.get(self.map_frame, self._in_force)
        return bool(self.map_frame) and (self._newest is not None or kept != self._in_force)

    def added_to(self, config: DaemonConfig) -> tuple[DaemonConfig, list[BadConfiguration]]:
        """Return a configuration with the newest mask in the map's frame, or else the last mask.

        Also return why the newest mask is not used: malformed, too fine, or in another frame.
        """
        frame = self.map_frame
        with self._lock:
            newest = self._newest if frame else None
            if newest is not None:
                self._newest = None
        faults: list[BadConfiguration] = []
        if newest is not None:
            try:
                self._read(newest)
            except FasacoError as error:
                what = error.what if isinstance(error, BadConfiguration) else str(error)
                faults.append(BadConfiguration(what, hint=error.hint, key="keep_out_mask"))
            else:
                mask_frame = next(reversed(self._masks))
                if mask_frame != frame:
                    text = f"in frame {mask_frame!r}, the map in {frame!r}"
                    hint = "publish map and mask in the same frame"
                    faults.append(BadConfiguration(text, hint=hint, key="keep_out_mask"))
        self._in_force = self._masks.get(frame, self._in_force)
        # Only a restart can replace the mask of a message by the mask of a file.
        mission = structs.replace(config.mission, keep_out_mask=self._in_force)
        return structs.replace(config, mission=mission), faults

    def _read(self, sample: Sample) -> None:
        most = most_bytes(topics.MAP.name, self._max_pixels)
        if sample.size > most:
            raise BadConfiguration(f"a message of {sample.size} bytes; it may have at most {most}")
        grid = decode_occupancy_grid(sample.payload, self._max_pixels)
        mask = inline_grid(grid, self._occupied_at_least)
        self._masks.pop(grid.frame, None)
        for other in list(self._masks)[:-1]:
            if other != self.map_frame:
                del self._masks[other]
        self._masks[grid.frame] = mask

    def _take(self, sample: Sample) -> None:
        with self._lock:
            self._waiting.pop(sample.sender, None)
            self._waiting[sample.sender] = sample, time.monotonic()
            if len(self._waiting) > MOST_WAITING:
                del self._waiting[next(iter(self._waiting))]
        self._arrived()
