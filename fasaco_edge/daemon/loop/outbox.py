"""The outbox: publishers of path, status, commands, and grids that change as the robot drives.

The last samples are kept for queries (``daemon.loop.last_samples``).
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from fasaco_edge.bus.queries import Reply, Shared
from fasaco_edge.bus.session import Bus
from fasaco_edge.daemon.figures import log_fault
from fasaco_edge.daemon.loop.last_samples import LastSamples, ShownTrail
from fasaco_edge.daemon.ros_bridge import RosBridge
from fasaco_edge.errors import FasacoError, NotPublished
from fasaco_edge.grid.occupancy import OccupancyGrid, coarser
from fasaco_edge.mission.core.events import Answer, CommandReceived
from fasaco_edge.mission.orders.order import command_document
from fasaco_edge.wire import schemas, topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.path_documents import PathAttachment, Rectangle
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.maps import coverage_values, encode_occupancy_grid
from fasaco_edge.wire.messages.paths import encode_path

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.core.path_exit import PublishedPath


LOG = logging.getLogger(__name__)

# Rate limit of log lines for repeated failures [s].
LOG_PERIOD_S = 10.0
# Limit on the failures that wait to be counted.
MOST_FAULTS = 100


class Outbox:
    """The publishers of a daemon; the last sample of each is kept for queries.

    Attributes:
        guard: publishes all messages.
    """

    def __init__(self, bus: Bus, keys: Keys, ros: RosBridge | None = None) -> None:
        self.guard = PublishGuard()
        self._id = bus.id
        self._ros = ros
        self._last = LastSamples(bus, keys)
        self._path = bus.advertise(keys, topics.PATH)
        self._coverage = bus.advertise(keys, topics.COVERAGE)
        self._floor = bus.advertise(keys, topics.FLOOR)
        self._unswept = bus.advertise(keys, topics.UNSWEPT)
        self._pheromone = bus.advertise(keys, topics.PHEROMONE)
        self._directions = bus.advertise(keys, topics.DIRECTIONS)
        self._rooms = bus.advertise(keys, topics.ROOMS)
        self._status = bus.advertise(keys, topics.STATUS)
        self._command = bus.advertise(keys, topics.COMMAND)

    def path(self, path: PublishedPath) -> bool:
        """Publish a path, by default facing along the way; return whether that succeeded."""
        return self.guard.attempt("path", lambda: self._put_path(path))

    def _put_path(self, path: PublishedPath) -> None:
        yaw = headings(path.xy) if path.yaw is None else path.yaw.copy()
        if len(yaw) and path.end_yaw is not None:
            yaw[-1] = path.end_yaw
        attachment = encode_json(structs.replace(path_attachment(path), daemon=self._id))
        payload = encode_path(path.xy, yaw, path.frame, path.map_stamp_ns)
        message = Shared.of(payload, schemas.PATH, attachment)
        self._last.keep_path(message, stops=path.stops)
        self._path.put(message.payload, attachment)
        if self._ros is not None:
            self._ros.path.put(message.payload)

    def forget(self) -> None:
        """Drop samples cached for late joiners: another daemon publishes them."""
        published = self._path, self._coverage, self._rooms, self._pheromone, self._directions
        for publisher in published:
            publisher.forget()
        if self._ros is not None:
            self._ros.path.forget()
            self._ros.coverage.forget()

    def status(self, status: Status) -> None:
        """Publish the status."""
        self.guard.attempt("status", lambda: self._say_status(status))

    def _say_status(self, status: Status) -> None:
        payload = encode_json(status)
        self._last.keep("status", Reply(payload))
        self._status.put(payload)
        if self._ros is not None:
            self._ros.diagnose(status)

    def commands(self, commands: Sequence[CommandReceived], answers: Sequence[Answer]) -> None:
        """Publish the accepted commands, for clients that did not see the query."""
        refused = {answer.number for answer in answers if answer.error is not None}
        for asked in commands:
            if asked.number not in refused:
                self.guard.attempt("command", partial(self._say_command, asked))

    def _say_command(self, asked: CommandReceived) -> None:
        self._command.put(encode_json(command_document(asked.asked)))

    def coverage(self, grid: OccupancyGrid) -> None:
        """Publish the coverage, a grid on the lattice; the caller catches failures."""
        coverage = Shared.of(encode_occupancy_grid(grid), schemas.OCCUPANCY_GRID)
        self._last.keep("coverage", coverage)
        self._coverage.put(coverage.payload)
        if self._ros is not None:
            self._ros.coverage.put(coverage.payload)

    def rooms(self, rooms: Rooms) -> None:
        """Publish the rooms; the caller catches failures."""
        payload = encode_json(rooms)
        self._last.keep("rooms", Reply(payload))
        self._rooms.put(payload)

    @property
    def shows_floor(self) -> bool:
        """Whether the swept floor has subscribers."""
        return self._floor.has_listeners()

    def floor(self, grid: OccupancyGrid) -> None:
        """Publish the swept floor; the caller catches failures."""
        self._floor.put(encode_occupancy_grid(grid))

    @property
    def shows_unswept(self) -> bool:
        """Whether the unswept floor has subscribers."""
        return self._unswept.has_listeners()

    def unswept(self, grid: OccupancyGrid) -> None:
        """Publish the unswept floor; the caller catches failures."""
        self._unswept.put(encode_occupancy_grid(grid))

    @property
    def shows_pheromone(self) -> bool:
        """Whether the pheromone field or its directions have subscribers."""
        return self._pheromone.has_listeners() or self._directions.has_listeners()

    def trail(self, shown: ShownTrail) -> None:
        """Publish the living trail and its directions; the caller catches failures."""
        self._pheromone.put(*shown.field())
        self._directions.put(shown.directions())

    def keep_trail(self, shown: ShownTrail) -> None:
        """Keep the living trail for queries."""
        self._last.keep_living(shown)


def headings(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heading [rad], float64 (n,), at each point of a path: towards the next one."""
    if len(xy) < 2:
        return np.zeros(len(xy))
    ahead = np.diff(xy, axis=0)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    return np.append(yaw, yaw[-1])


def path_attachment(path: PublishedPath) -> PathAttachment:
    """Return the attachment of a path."""
    changed = path.changed and Rectangle(*(round(edge, 3) for edge in path.changed))
    return structs.replace(
        PathAttachment.of(path.plan),
        revision=path.revision,
        map_stamp_ns=path.map_stamp_ns,
        map_revision=path.map_revision,
        reason=path.reason,
        steps=path.steps,
        plan_ms=round(1e3 * path.plan_s, 3),
        changed=changed,
        speed_m_s=path.speed_m_s,
    )


class PublishGuard:
    """Publishes the loop's messages: a failure affects that message alone.

    All failures are counted; one per topic in ``LOG_PERIOD_S`` is logged.
    """

    def __init__(self) -> None:
        self._faults: list[FasacoError] = []
        self._logged_at: dict[str, float] = {}

    def attempt(self, topic: str, publish: Callable[[], None]) -> bool:
        """Make and send a message; return whether that succeeded."""
        try:
            publish()
        except Exception as error:
            why = (
                str(error) if isinstance(error, FasacoError) else f"{type(error).__name__}: {error}"
            )
            fault = NotPublished(f"{topic} was not published: {why}")
            now = time.monotonic()
            if now - self._logged_at.get(topic, float("-inf")) >= LOG_PERIOD_S:
                self._logged_at[topic] = now
                log_fault(LOG, fault)
                if not isinstance(error, FasacoError):
                    LOG.exception("%s", topic)
            if len(self._faults) < MOST_FAULTS:
                self._faults.append(fault)
            return False
        return True

    def take_faults(self) -> list[FasacoError]:
        """Return the failures since the last call; they are logged already."""
        faults, self._faults = self._faults, []
        return faults


# Least period of the coverage [s].
COVERAGE_PERIOD_S = 0.5
# Least period of the swept floor [s], and limit on its squares: a large floor gets larger squares.
FLOOR_PERIOD_S = 2.0
MOST_SQUARES = 1_000_000
# A raster of more pixels is looked at for unswept floor less often: 8 million take the loop 25 ms.
PIXELS_PER_S = 1_000_000
# Period at which floor and trail are published again unchanged [s]: a listener that comes while
# others listen is not noticed.
REPEAT_S = 10.0
# Least period of the trail [s]; a large one, which takes the loop some milliseconds per 100,000
# cells, is published less often.
PERIOD_S = 0.5
CELLS_PER_S = 200_000


class CoveragePublisher:
    """Publishes the coverage grid on change, at most twice a second."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._published_at = float("-inf")
        self._key: tuple[object, ...] = ()

    def forget(self) -> None:
        """Publish the next grid even if it has not changed."""
        self._key = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Publish the coverage if that is due."""
        # An order may reset the coverage, and add keep-out cells.
        key = (mission.covered.version, mission.map_revision, mission.order_state)
        if key == self._key or now - self._published_at < COVERAGE_PERIOD_S:
            return
        lattice, grid = mission.lattice, mission.grid
        if lattice is None or grid is None:
            return
        self._published_at, self._key = now, key
        geometry = mission.rotation.cells(lattice.window, lattice.cell_m)
        values = coverage_values(lattice.states, mission.covered.visits(lattice.window))
        self._outbox.coverage(OccupancyGrid(geometry, values, grid.frame, grid.stamp_ns))


class FloorPublisher:
    """Publishes the swept floor if it has subscribers: on change, every two seconds at most."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._published_at = float("-inf")
        self._key: tuple[object, ...] = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Publish the swept floor if that is due."""
        if not self._outbox.shows_floor:
            self._key = ()  # the next listener has not received it
            return
        floor, grid = mission.floor, mission.grid
        key = (floor, floor.changes)
        least_s = REPEAT_S if key == self._key else FLOOR_PERIOD_S
        if now - self._published_at < least_s or grid is None:
            return
        self._published_at, self._key = now, key
        shown = floor.snapshot().shown(MOST_SQUARES, grid.frame, grid.stamp_ns)
        if shown is not None:
            self._outbox.floor(replace(shown, geometry=mission.rotation.geometry(shown.geometry)))


class UnsweptPublisher:
    """Publishes why floor is not swept while that has subscribers: on change, as the floor."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._due = self._published_at = float("-inf")
        self._key: tuple[object, ...] = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Publish the unswept floor if that is due."""
        if not self._outbox.shows_unswept:
            self._key = ()  # the next listener has not received it
            return
        if now < self._due:
            return
        key = (mission.map_revision, mission.floor_to_sweep())
        if key == self._key and now - self._published_at < REPEAT_S:
            return
        self._published_at, self._key = now, key
        if (shown := mission.unswept()) is not None:
            self._due = now + max(FLOOR_PERIOD_S, shown.cells.size / PIXELS_PER_S)
            self._outbox.unswept(coarser(shown, MOST_SQUARES))


class TrailPublisher:
    """Publishes the trail on change, at most twice a second.

    It is published while it has subscribers, and kept for queries.
    """

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._due = self._published_at = float("-inf")
        # The trail kept last, and the trail published last.
        self._kept: tuple[object, ...] = ()
        self._published: tuple[object, ...] = ()

    def publish(self, mission: Mission, now: float) -> None:
        """Publish or keep the trail if due."""
        has_subscribers = self._outbox.shows_pheromone
        if not has_subscribers:
            self._published = ()  # the next listener has not received it
        trail, lattice, grid = mission.trail, mission.lattice, mission.grid
        key = (trail, trail.changes)
        is_published = key == self._published and now - self._published_at < REPEAT_S
        is_known = key == self._kept and (not has_subscribers or is_published)
        if is_known or now < self._due or grid is None or lattice is None:
            return
        held = trail.snapshot()
        cells = held.window.rows * held.window.cols
        if not cells:
            return
        self._due = now + max(PERIOD_S, cells / CELLS_PER_S)
        steps = max(len(mission.route.path.ahead) - 1, 0)
        of_path = mission.route.revision, steps
        shown = ShownTrail(
            held,
            trail.ants,
            lattice.cell_m,
            grid.frame,
            *of_path,
            time.time_ns(),
            mission.rotation.deg,
        )
        self._kept = key
        self._outbox.keep_trail(shown)
        if has_subscribers:
            self._published, self._published_at = key, now
            self._outbox.trail(shown)
