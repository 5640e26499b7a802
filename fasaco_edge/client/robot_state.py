"""The state of a robot by its newest pose, status and commands, and the latest events.

Without numpy, for small programs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.events import BAD, GOOD, ORDER, EventLog, differences
from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.text import is_reported
from fasaco_edge.wire.documents.json_text import OF_JSON, decode_document, decode_json
from fasaco_edge.wire.documents.settings import KnownSettings, known_settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.limits import MAX_COORDINATE_M
from fasaco_edge.wire.messages.poses import decode_pose
from fasaco_edge.wire.schemas import POSE_STAMPED

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Points = Sequence[tuple[float, float]] | NDArray[np.float64]

# The daemon publishes a status once a second.
SILENCE_S = 3.5
# If no pose has come on its own key for this long [s], the poses in the status are shown.
POSE_LASTS_S = 2.0


@dataclass(frozen=True, slots=True)
class Token:
    """A robot's daemon that has appeared (``here``) or gone."""

    robot: str
    here: bool


class RobotState:
    """The newest pose and status of one robot, and the latest events.

    Attributes:
        pose: where the robot is; None before the first pose.
        status: the newest one; None before the first.
        document: its bytes, b"" before the first.
        settings: of the daemon, from the status.
        walk: the path, and the robot's progress on it.
        robots: names of all robots on the bus with a daemon.
        trouble: why the bus cannot be reached; "" if it can.
        gone_since: when the daemon disappeared, since the epoch [s]; None while it is present,
            and before it first appeared.
    """

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.events = EventLog()
        self.pose: Pose2D | None = None
        self.status: Status | None = None
        self.document = b""
        self.settings = KnownSettings()
        self.walk = PathProgress()
        self.robots: set[str] = set()
        self.trouble = ""
        self.gone_since: float | None = None
        self._reported_at = self._posed_at = float("-inf")
        self._malformed = 0
        self._readers: dict[str, Callable[[Sample, float], None]] = {
            "pose": self._read_pose,
            "status": self._read_status,
            "command": self._read_command,
        }

    @property
    def is_here(self) -> bool:
        """Whether the robot's daemon is on the bus."""
        return self.robot in self.robots

    def silent_s(self, now: float) -> float:
        """Return how long a status of the daemon is overdue [s]; 0 if it is not."""
        silent = now - self._reported_at
        return silent if self.status is not None and silent > SILENCE_S else 0.0

    def take(self, topic: str, item: object, now: float) -> None:
        """Take in a sample of ``topic`` or a Token that arrived ``now``, since the epoch [s].

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
        # A faulty publisher may send only malformed ones.
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
            # The daemon has not had the time to publish a status.
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
            # The sender may be a second daemon of this name, whose state is not the robot's.
            if status.claim.stand != "looks":
                self.events.add(now, f"a second daemon is {status.state}: {status.reason}", BAD)
            return
        for text, tone in differences(self.status, status):
            self.events.add(now, text, tone)
        if self.status is None or status.config != self.status.config:
            self.settings = known_settings(status.config)
        self.status, self.document, self._reported_at = status, sample.payload, now
        if status.path is None:
            # A restarted daemon has none of the old paths.
            self.walk = PathProgress()
        elif status.path.revision == self.walk.revision:
            self.walk.left(status.path.remaining_steps)
        pose = status.pose
        if pose is not None and now - self._posed_at > POSE_LASTS_S:
            self._move(Pose2D(pose.x, pose.y, pose.yaw))

    def _read_command(self, sample: Sample, now: float) -> None:
        self._follow(decode_json(sample.payload), now)

    def _follow(self, document: dict[str, object], now: float) -> None:
        """Note a command that the mission has taken."""
        order = document.get("order")
        names = [str(zone["name"]) for zone in _zones(order)]
        about = f" with {', '.join(names)}" if names else ""
        if isinstance(keep_out := document.get("keep_out"), dict):
            about = f" {keep_out.get('name')}"
        self.events.add(now, f"command {document.get('command')}{about}", ORDER)

    def _move(self, pose: Pose2D) -> None:
        if abs(pose.x) <= MAX_COORDINATE_M and abs(pose.y) <= MAX_COORDINATE_M:
            self.pose = pose
            self.walk.passed(pose)


def _zones(order: object) -> list[dict[str, object]]:
    zones = order.get("zones") if isinstance(order, dict) else None
    found = zones if isinstance(zones, list) else []
    return [zone for zone in found if isinstance(zone, dict) and "name" in zone]


# Poses are more frequent than steps: further ahead, a path may pass the position again.
LOOK_AHEAD_STEPS = 8


class PathProgress:
    """A path, and the robot's progress on it.

    Attributes:
        xy: points (x, y) [m]; an array, float64 (n, 2), or a list.
        revision: number of the path.
        at: index of the last point reached.
    """

    def __init__(self, xy: Points = (), revision: int = 0) -> None:
        self.xy = xy
        self.revision = revision
        self.at = 0

    def left(self, steps: int) -> None:
        """Note the daemon's number of remaining steps."""
        self.at = max(self.at, len(self.xy) - 1 - max(steps, 0))

    def passed(self, pose: Pose2D) -> None:
        """Note the robot's position; progress only grows."""
        near = self.xy[self.at : self.at + LOOK_AHEAD_STEPS]
        if len(near) < 2:
            return
        step_m = math.dist(near[0], near[1])
        away = [math.hypot(x - pose.x, y - pose.y) for x, y in near]
        closest = min(range(len(away)), key=away.__getitem__)
        if away[closest] <= step_m:
            self.at += closest
