"""Fleet messages: sent to the other robots, filtered and received from them; the fleet's status.

Unused without a block ``fleet`` in the configuration.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.bus.session import Bus
from fasaco_edge.config.config import DaemonConfig, FleetConfig
from fasaco_edge.errors import FasacoError, FleetError
from fasaco_edge.fleet.mission.frames import MOST_OTHERS, FleetFrames
from fasaco_edge.fleet.mission.kind import FleetKind, giving_way_of, layer_of
from fasaco_edge.fleet.mission.message import Messages, waits_for
from fasaco_edge.fleet.mission.shared import MapPlace
from fasaco_edge.fleet.mission.tiles import Placed
from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.mission.events import MemberReceived, Part
from fasaco_edge.wire.documents.fleet import (
    FLEET_VERSION,
    CellTile,
    FleetMember,
    FleetPart,
    decode_member,
    fleet_of,
)
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.status import FleetReport, MemberReport
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.limits import MAX_FLEET_POINTS, MAX_JSON_BYTES
from fasaco_edge.wire.topics import FLEET

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission


PERIOD_S, LEAST_PERIOD_S = 1.0, 0.25
# Most tiles of swept cells, and also of ground, in a periodic message (once a second) and in a
# message on a change. A robot sends 20 kB/s, and up to 27 kB/s after a change of the epoch.
TILES, FEW_TILES = 10, 2
# Members with the same names in a robot's message and in its event.
ALIKE = ("state", "x", "y", "step_s", "epoch", "division", "by", "radius_m", "waits_for")

# Least time between two messages of a robot [s].
LEAST_SPACING_S = 0.2
# A robot silent for this long makes room for another [s].
FORGOTTEN_S = 60.0


def kind_of(config: DaemonConfig) -> FleetKind:
    """Return the kind of company of a daemon with a block ``fleet``."""
    fleet = config.fleet
    assert fleet
    place = MapPlace(_origin(fleet), fleet.map_frame) if fleet.frame else None
    return FleetKind(config.robot.name, place)


class FleetArrivals:
    """Filter and rate limit of other robots' messages by key; runs on a Zenoh thread.

    All fleets under one ``bus.base`` publish on the same keys; other publishers can, too. Robots of
    this fleet and other publishers are tracked separately, each up to a limited number.

    Args:
        keys: keys of this robot.
        fleet: name of its fleet.
    """

    def __init__(self, keys: Keys, fleet: str) -> None:
        self._keys, self._fleet = keys, fleet
        # Time of each key's last message [s], oldest first: robots of this fleet; other publishers.
        self._received_at: dict[str, float] = {}
        self._strange_at: dict[str, float] = {}
        # Time of the last message with an unreadable fleet that was passed to the loop, which
        # reports the fault [s].
        self._unreadable_at = float("-inf")
        self._has_refused = False
        self._faults = deque[FasacoError](maxlen=1)

    def is_due(self, sample: Sample, now: float) -> bool:
        """Return whether the loop gets a message; ``now`` is monotonic time [s]."""
        key, spaced = sample.key, now - LEAST_SPACING_S
        if self._keys.robot_of(key) in ("", self._keys.robot):
            return False
        if max(_time(self._received_at, key), _time(self._strange_at, key)) > spaced:
            return False
        fleet = fleet_of(sample.payload) if sample.size <= MAX_JSON_BYTES else None
        is_mate = fleet == self._fleet
        if key in self._received_at and (is_mate or fleet is None):
            _note(self._received_at, key, now)
            return True
        if is_mate:
            return self._has_place(key, now)
        if len(self._strange_at) >= MOST_OTHERS and key not in self._strange_at:
            del self._strange_at[next(iter(self._strange_at))]
        _note(self._strange_at, key, now)
        if fleet is not None or self._unreadable_at > spaced:
            return False
        self._unreadable_at = now
        return True

    def take_faults(self) -> list[FasacoError]:
        """Return the faults since the last call; on the loop's thread."""
        return [self._faults.popleft() for _ in range(len(self._faults))]

    def _has_place(self, key: str, now: float) -> bool:
        """Track another robot of this fleet if there is a free place; return whether there is."""
        if len(self._received_at) >= MOST_OTHERS:
            oldest = next(iter(self._received_at))
            if now - self._received_at[oldest] < FORGOTTEN_S:
                if not self._has_refused:
                    self._has_refused = True
                    text = f"at most {MOST_OTHERS} others of fleet {self._fleet!r} are kept"
                    self._faults.append(FleetError(f"{self._keys.robot_of(key)}: {text}"))
                return False
            del self._received_at[oldest]
        self._strange_at.pop(key, None)
        self._has_refused = False
        _note(self._received_at, key, now)
        return True


def _time(times: dict[str, float], key: str) -> float:
    return times.get(key, float("-inf"))


def _note(times: dict[str, float], key: str, now: float) -> None:
    times.pop(key, None)
    times[key] = now


class FleetReceiver:
    """Receiver of the messages of a fleet's other robots.

    Args:
        config: with a block ``fleet``.
    """

    def __init__(self, config: DaemonConfig) -> None:
        assert config.fleet
        self._keys, self._fleet, self._cell_m = config.keys(), config.fleet.name, config.cell_m
        self._lattice_deg = config.lattice_deg or 0.0
        self._frame, self._frames = config.fleet.frame, None
        if self._frame:
            origin = _origin(config.fleet)
            self._frames = FleetFrames(_pose(*origin), self._lattice_deg, self._cell_m)
        self._arrivals = FleetArrivals(self._keys, self._fleet)
        # Faults of messages that were accepted without their division.
        self._faults: list[FasacoError] = []

    def listen(self, bus: Bus, post: Callable[[Sample], None]) -> None:
        """Pass on the messages of this fleet within their rate limit."""

        def post_due(sample: Sample) -> None:
            if self._arrivals.is_due(sample, time.monotonic()):
                post(sample)

        bus.subscribe(self._keys.of_all(FLEET), post_due)

    def event(self, sample: Sample) -> MemberReceived | None:
        """Return another robot's message as an event; None if the robot is of another fleet.

        Raises:
            MalformedMessage: the message is malformed.
        """
        robot = self._keys.robot_of(sample.key)
        try:
            member = decode_member(sample.payload, self._fleet)
        except FleetError as error:
            return MemberReceived(robot, misfit=str(error))
        except FasacoError as error:
            raise type(error)(f"{robot}: {error}") from error
        if member is None:
            return None
        misfit = ""
        if abs(member.cell_m - self._cell_m) > 1e-9:
            misfit = f"its cells are {member.cell_m:g} m wide, here they are {self._cell_m:g} m"
        if self._frame and member.frame != self._frame:
            misfit = f"its frame is {member.frame!r}, that of this fleet is {self._frame!r}"
        if not self._frame and abs(member.lattice_deg - self._lattice_deg) > 1e-9:
            misfit = (
                f"its cells lie at {member.lattice_deg:g} degrees to the map frame, here at "
                f"{self._lattice_deg:g}"
            )
        received = MemberReceived(
            robot=robot,
            misfit=misfit,
            frame=member.frame,
            tiles=_placed(member.swept),
            ground=_placed(member.ground),
            parts=tuple(
                Part(part.robot, (part.row, part.col), part.handicap_s, part.step_s)
                for part in member.parts
            ),
            ahead=member.ahead,
            kept=None if member.kept is None else _placed(member.kept),
            **{name: getattr(member, name) for name in ALIKE},
        )
        if self._frames is None or misfit:
            return received
        placed = self._frames.event(received, _pose(*member.origin), member.lattice_deg)
        if received.parts and not placed.parts:
            self._faults.append(
                FleetError(f"{robot}: its division has a seed outside this robot's limits")
            )
        return placed

    def take_faults(self) -> list[FasacoError]:
        """Return the faults since the last call, except faults that ``event`` raised."""
        faults, self._faults = self._faults, []
        return faults + self._arrivals.take_faults()


class FleetSender:
    """Publisher of this robot's message: once a second, on change, and more often near a robot.

    Args:
        publisher: publisher of the robot's own key.
        config: with a block ``fleet``.
    """

    def __init__(self, publisher: Publisher, config: DaemonConfig) -> None:
        assert config.fleet
        self._publisher, self._fleet, self._cell_m = publisher, config.fleet.name, config.cell_m
        self._frame, self._origin = config.fleet.frame, _origin(config.fleet)
        self._messages = Messages(config.robot.name, config.robot.radius_m)
        self._sent: tuple[object, ...] = ()
        # Times of the last message, and of the last periodic message [s].
        self._sent_at = self._periodic_at = float("-inf")

    def publish(self, mission: Mission, now: float) -> None:
        """Publish a message if due; the caller catches failures."""
        if now - self._sent_at < LEAST_PERIOD_S:
            return
        layer, giving_way = layer_of(mission), giving_way_of(mission)
        key = mission.state, layer.numbers.number, layer.others.shared.epoch, waits_for(mission)
        is_news, is_due = key != self._sent, now - self._periodic_at >= PERIOD_S
        if not (is_news or is_due or giving_way.is_near):
            return
        most = TILES if is_due else FEW_TILES if is_news else 0
        message = self._messages.next(mission, most, TILES)
        if message is None:
            return
        self._sent, self._sent_at = key, now
        if is_due:
            self._periodic_at = now
        member = FleetMember(
            version=FLEET_VERSION,
            fleet=self._fleet,
            cell_m=self._cell_m,
            lattice_deg=mission.rotation.deg,
            frame=self._frame_sent(mission),
            open_cells=mission.orders.cells.left(),
            swept=_tiles(message.tiles),
            ground=_tiles(message.ground),
            parts=tuple(
                FleetPart(part.robot, *part.seed, part.handicap_s, part.step_s)
                for part in message.parts
            ),
            ahead=tuple((round(x, 3), round(y, 3)) for x, y in _thinned(message.ahead)),
            origin=self._origin,
            kept=None if message.kept is None else _tiles(message.kept),
            **{name: getattr(message, name) for name in ALIKE},
        )
        self._publisher.put(encode_json(member))

    def _frame_sent(self, mission: Mission) -> str:
        """Return the fleet's frame; the map's own frame while the map's pose is unknown."""
        frame = mission.covered.current.frame
        if not layer_of(mission).others.shared.why_misplaced(frame):
            return self._frame or frame
        # Other robots must not mistake the map's frame for the fleet's frame.
        return frame if self._frame not in ("", frame) else f"{frame} of another map"


def _thinned(points: Sequence[Point]) -> Sequence[Point]:
    """Return a line's points [m], evenly thinned to the number that a message holds.

    Both ends remain. With cells narrower than 3.2 cm, a line of 2 m has too many points.
    """
    if len(points) <= MAX_FLEET_POINTS:
        return points
    chosen = np.linspace(0, len(points) - 1, MAX_FLEET_POINTS).round().astype(int)
    return [points[at] for at in chosen.tolist()]


def _tiles(tiles: Iterable[Placed]) -> tuple[CellTile, ...]:
    return tuple(CellTile(*place, bits) for place, bits in tiles)


def _origin(fleet: FleetConfig) -> tuple[float, float, float]:
    return fleet.x_m, fleet.y_m, fleet.yaw_deg


def _pose(x: float, y: float, deg: float) -> Pose2D:
    return Pose2D(x, y, math.radians(deg))


def _placed(tiles: Iterable[CellTile]) -> tuple[Placed, ...]:
    return tuple(((tile.row, tile.col), tile.cells) for tile in tiles)


def report(fleet: str, mission: Mission | None, now: float) -> FleetReport:
    """Return the report of the fleet with the name ``fleet`` at ``now`` [s]."""
    if mission is None:
        return FleetReport(fleet)
    layer = layer_of(mission)
    members = tuple(
        MemberReport(
            name,
            member.newest.state,
            round(max(now - member.received_at, 0.0), 1),
            member.absence(now) or None,
            layer.others.shared.cells_of(name),
        )
        for name, member in sorted(layer.others.known.items())
    )
    return FleetReport(fleet, layer.numbers.number, layer.part_cells(), members)
