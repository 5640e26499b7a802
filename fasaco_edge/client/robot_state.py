"""State of a robot by its newest pose, status and commands, and the latest events.

Without numpy, for small programs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.phrases import BAD, GOOD, ORDER, EventLog, differences
from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.text import is_reported
from fasaco_edge.wire.documents.json_text import OF_JSON, decode_document, decode_json
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.documents.settings import KnownSettings, known_settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.limits import MAX_COORDINATE_M
from fasaco_edge.wire.messages.poses import decode_pose
from fasaco_edge.wire.schemas import POSE_STAMPED

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Points = Sequence[tuple[float, float]] | NDArray[np.float64]

# The daemon is silent after this time without a status [s]; it publishes one a second.
SILENCE_S = 3.5
# A map is complete once it has not grown for COMPLETE_S [s], and for COMPLETE_SHARE of the time in
# which it grew. The share is for large maps: a robot that sweeps explored floor finds nothing new
# for minutes.
COMPLETE_S, COMPLETE_SHARE = 180.0, 0.5
# Time without a pose on its own key after which the poses in the status are used [s].
POSE_LASTS_S = 2.0


@dataclass(frozen=True, slots=True)
class Token:
    """News that a robot's daemon has appeared (``here``) or disappeared."""

    robot: str
    here: bool


class RobotState:
    """The newest pose and status of one robot, and the latest events.

    Attributes:
        pose: pose of the robot; None before the first.
        status: newest status; None before the first.
        document: bytes of the newest status; b"" before the first.
        settings: settings of the daemon, from the status.
        rooms: newest rooms; empty before the first.
        walk: the path, and the robot's progress on it.
        robots: names of all robots on the bus with a daemon.
        trouble: why the bus cannot be reached; "" if it can.
        gone_since: time since the epoch when the daemon disappeared [s]; None while it is present,
            and before it first appeared.
    """

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.events = EventLog()
        self.pose: Pose2D | None = None
        self.status: Status | None = None
        self.document = b""
        self.settings = KnownSettings()
        self.rooms = Rooms()
        self.walk = WatchedPath()
        self.robots: set[str] = set()
        self.trouble = ""
        self.gone_since: float | None = None
        self._reported_at = self._posed_at = self._grew_at = float("-inf")
        self._began_at = 0.0
        self._malformed = 0
        self._readers: dict[str, Callable[[Sample, float], None]] = {
            "pose": self._read_pose,
            "status": self._read_status,
            "command": self._read_command,
            "rooms": self._read_rooms,
        }

    @property
    def is_here(self) -> bool:
        """Whether the robot's daemon is on the bus."""
        return self.robot in self.robots

    def grows(self, now: float) -> bool:
        """Return whether more floor may become reachable, so that the work left is not known."""
        least_s = COMPLETE_S / max(self.settings.robot.time_scale, 1.0)
        quiet_s = max(least_s, COMPLETE_SHARE * (self._grew_at - self._began_at))
        return now - self._grew_at < quiet_s

    def silent_s(self, now: float) -> float:
        """Return how long a status of the daemon is overdue [s]; 0 if it is not."""
        silent = now - self._reported_at
        return silent if self.status is not None and silent > SILENCE_S else 0.0

    def take(self, topic: str, item: object, now: float) -> None:
        """Take in a sample of ``topic``, or a Token; ``now`` is time since the epoch [s].

        An unreadable sample is dropped and noted.
        """
        if isinstance(item, Token):
            self._note_token(item, now)
        elif isinstance(item, Sample):
            try:
                self._readers[topic](item, now)
            except FasacoError as error:
                self.note_unreadable(topic, error, now)

    def note_unreadable(self, topic: str, error: FasacoError, now: float) -> None:
        """Note that a sample of ``topic`` could not be read."""
        self._malformed += 1
        # A faulty publisher may send many malformed samples.
        if is_reported(self._malformed):
            text = f"{topic} cannot be read ({self._malformed} so far): {error}"
            self.events.add(now, text, BAD)

    def _note_token(self, token: Token, now: float) -> None:
        was_here = self.is_here
        (self.robots.add if token.here else self.robots.discard)(token.robot)
        if was_here and not self.is_here:
            self.gone_since = now
            self.events.add(now, "the daemon is gone; waiting for it to return", BAD)
        elif self.is_here and not was_here:
            back = self.gone_since is not None
            # The daemon has not had time to publish a status.
            self.gone_since, self._reported_at = None, now
            self.events.add(now, f"the daemon is {'back' if back else 'there'}", GOOD)

    def _read_pose(self, sample: Sample, now: float) -> None:
        schema = sample.schema or self.settings.pose.schema or POSE_STAMPED
        stamped = decode_pose(sample.payload, schema)
        self._posed_at = now
        self._move(stamped.pose)

    def _read_status(self, sample: Sample, now: float) -> None:
        status = decode_document(sample.payload, Status)
        if not status.state:
            raise MalformedMessage("status: it has no state", hint=OF_JSON)
        if status.claim.stand != "plans":
            # The sender is a second daemon of this name, whose state is not the robot's.
            if status.claim.stand != "looks":
                self.events.add(now, f"a second daemon is {status.state}: {status.reason}", BAD)
            return
        for text, tone in differences(self.status, status):
            self.events.add(now, text, tone)
        if self.status is None or status.config != self.status.config:
            self.settings = known_settings(status.config)
        self._watch_growth(status, now)
        self.status, self.document, self._reported_at = status, sample.payload, now
        if status.path is None:
            # A restarted daemon has no path yet.
            self.walk = WatchedPath()
        # The number of steps left gives the progress only if the path's points are its cells.
        elif (status.path.revision, status.path.steps) == (
            self.walk.revision,
            len(self.walk.xy) - 1,
        ):
            self.walk.note_remaining(status.path.remaining_steps)
        pose = status.pose
        if pose is not None and now - self._posed_at > POSE_LASTS_S:
            self._move(Pose2D(pose.x, pose.y, pose.yaw))

    def _watch_growth(self, status: Status, now: float) -> None:
        before = self.status
        if before is None or before.coverage is None or _order_of(before) != _order_of(status):
            self._began_at = now
        elif status.coverage and status.coverage.coverable > before.coverage.coverable:
            self._grew_at = now

    def _read_rooms(self, sample: Sample, _: float) -> None:
        self.rooms = decode_document(sample.payload, Rooms)

    def _read_command(self, sample: Sample, now: float) -> None:
        self._follow(decode_json(sample.payload), now)

    def _follow(self, document: dict[str, object], now: float) -> None:
        order = document.get("order")
        names = [str(zone["name"]) for zone in _zones(order)]
        about = f" with {', '.join(names)}" if names else ""
        if isinstance(keep_out := document.get("keep_out"), dict):
            about = f" {keep_out.get('name')}"
        if isinstance(room := document.get("room"), dict):
            about = f" {room.get('id')}"
        self.events.add(now, f"command {document.get('command')}{about}", ORDER)

    def _move(self, pose: Pose2D) -> None:
        if abs(pose.x) <= MAX_COORDINATE_M and abs(pose.y) <= MAX_COORDINATE_M:
            self.pose = pose
            self.walk.note_position(pose)


def _order_of(status: Status) -> tuple[object, ...]:
    return status.mission.ordered, *(zone.name for zone in status.mission.zones)


def _zones(order: object) -> list[dict[str, object]]:
    zones = order.get("zones") if isinstance(order, dict) else None
    found = zones if isinstance(zones, list) else []
    return [zone for zone in found if isinstance(zone, dict) and "name" in zone]


# Largest progress along the path from one pose to the next [m], as the path may pass the same place
# again farther ahead.
LOOK_AHEAD_M = 2.5
# Largest distance of a robot that is on its path [m]. If the path passes the robot several times at
# distances that differ by less than EQUAL_M [m], the first place counts.
NEAR_M, EQUAL_M = 0.5, 0.02


class WatchedPath:
    """A path, and the robot's progress on it.

    Attributes:
        xy: points (x, y) [m]; an array, float64 (n, 2), or a list.
        revision: number of the path.
        at: index of the last point reached.
        beyond_m: distance of the robot beyond that point, along the path [m].
    """

    def __init__(self, xy: Points = (), revision: int = 0) -> None:
        self.xy = xy
        self.revision = revision
        self.at = 0
        self.beyond_m = 0.0

    def note_remaining(self, steps: int) -> None:
        """Note the number of remaining steps, each from one point to the next."""
        at = len(self.xy) - 1 - max(steps, 0)
        if at > self.at:
            self.at, self.beyond_m = at, 0.0

    def join(self, pose: Pose2D) -> None:
        """Note the robot's position on a path of which it may have driven a part already."""
        if not self._find(pose, LOOK_AHEAD_M):
            self._find(pose, math.inf)

    def note_position(self, pose: Pose2D) -> None:
        """Note the robot's position; progress only grows."""
        self._find(pose, LOOK_AHEAD_M)

    def _find(self, pose: Pose2D, ahead_m: float) -> bool:
        """Advance to the nearest place up to ``ahead_m`` ahead [m]; return whether there is one."""
        nearest_m, place, begin_m = NEAR_M, None, -self.beyond_m
        for index in range(self.at, len(self.xy) - 1):
            if begin_m > ahead_m:
                break
            (x0, y0), (x1, y1) = self.xy[index], self.xy[index + 1]
            length_m = math.hypot(x1 - x0, y1 - y0)
            if length_m:
                along_m = ((pose.x - x0) * (x1 - x0) + (pose.y - y0) * (y1 - y0)) / length_m
                along_m = min(max(along_m, -begin_m, 0.0), length_m, ahead_m - begin_m)
                share = along_m / length_m
                near = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
                away_m = math.hypot(near[0] - pose.x, near[1] - pose.y)
                if away_m < nearest_m - (EQUAL_M if place else 0.0):
                    nearest_m, place = away_m, (index, along_m, length_m)
            begin_m += length_m
        if place is None:
            return False
        index, along_m, length_m = place
        is_end = length_m - along_m < EQUAL_M
        self.at, self.beyond_m = (index + 1, 0.0) if is_end else (index, along_m)
        return True
