"""A keep-out mask that comes as a message: Nav2's, or of whatever draws one.

It takes the place of the file ``mission.keep_out_mask`` in the configuration in force, as a reload
does: recordings and replays know it from there. Reading one takes as much memory as a map; maps
wait meanwhile.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from msgspec import structs

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.session import Bus
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.memory import most_bytes
from fasaco_edge.daemon.ros_bridge import RosBridge
from fasaco_edge.errors import BadConfiguration, FasacoError
from fasaco_edge.mission.orders.mask import inline_grid
from fasaco_edge.wire import topics
from fasaco_edge.wire.messages.maps import decode_occupancy_grid


class MaskTopic:
    """Subscribes to the mask, and puts the newest one into a configuration.

    Args:
        bus: the session.
        config: of the daemon.
        ros: its side towards ROS 2; None without one.
        came: called for each mask, on a Zenoh thread.

    Attributes:
        map_frame: the frame of the map, which must be the mask's; until it is known, "", a mask
            waits.
    """

    def __init__(
        self, bus: Bus, config: DaemonConfig, ros: RosBridge | None, came: Callable[[], None]
    ) -> None:
        self._max_pixels = config.map.max_pixels
        self._occupied_at_least = config.map.occupied_at_least
        self._came = came
        self.map_frame = ""
        self._lock = threading.Lock()
        self._newest: Sample | None = None
        self._inline = ""
        bus.listen(config.keys(), topics.KEEP_OUT_MASK, self._take)
        if ros is not None:
            ros.subscribe_mask(self._take)

    @property
    def has_come(self) -> bool:
        """Whether there is a mask that can be put into a configuration."""
        return self._newest is not None and bool(self.map_frame)

    def added_to(self, config: DaemonConfig) -> DaemonConfig:
        """Return a configuration with the newest mask.

        Raises:
            BadConfiguration: that is malformed, or too fine; the one before stays.
        """
        with self._lock:
            newest = self._newest if self.map_frame else None
            if newest is not None:
                self._newest = None
        if newest is not None:
            self._inline = self._read(newest)
        if not self._inline or not config.mission.keep_out_topic:
            return config
        mission = structs.replace(config.mission, keep_out_mask=self._inline)
        return structs.replace(config, mission=mission)

    def _read(self, sample: Sample) -> str:
        most = most_bytes(topics.MAP.name, self._max_pixels)
        if sample.size > most:
            raise BadConfiguration(
                f"keep_out_mask: a message of {sample.size} bytes; it may have at most {most}"
            )
        try:
            grid = decode_occupancy_grid(sample.payload, self._max_pixels)
            if grid.frame != self.map_frame:
                raise BadConfiguration(
                    f"keep_out_mask: in frame {grid.frame!r}, the map in {self.map_frame!r}",
                    hint="publish map and mask in the same frame",
                )
            return inline_grid(grid, self._occupied_at_least)
        except FasacoError as error:
            if isinstance(error, BadConfiguration):
                raise
            raise BadConfiguration(f"keep_out_mask: {error}", hint=error.hint) from None

    def _take(self, sample: Sample) -> None:
        with self._lock:
            self._newest = sample
        self._came()
