"""A robot as its newest samples show it, and the latest events."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.json_text import decode_document, decode_json
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.limits import MAX_COORDINATE_M
from fasaco_edge.wire.messages.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.messages.pheromone import decode_pheromone
from fasaco_edge.wire.messages.poses import decode_pose
from fasaco_edge.wire.schemas import POSE_STAMPED

KEPT = 200
# Number of levels that the field is shown in.
FIELD_LEVELS = 7
# Tone of an entry.
PLAIN, GOOD, BAD, ORDER = "plain", "good", "bad", "order"
TROUBLED = ("blocked", "degraded")


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened: when, since the epoch [s], what, and its tone."""

    at_s: float
    text: str
    tone: str = PLAIN


class EventLog:
    """The newest entries, and how many there ever were."""

    def __init__(self) -> None:
        self.entries: deque[Event] = deque(maxlen=KEPT)
        self.count = 0

    def add(self, at_s: float, text: str, tone: str = PLAIN) -> None:
        """Note what happened at ``at_s``, since the epoch [s]."""
        self.entries.append(Event(at_s, one_line(text), tone))
        self.count += 1

    def since(self, count: int) -> list[Event]:
        """Return what was noted after the first ``count`` entries, as far as it is kept."""
        new = min(self.count - count, len(self.entries))
        return list(self.entries)[len(self.entries) - new :]


def differences(before: Status | None, after: Status) -> list[tuple[str, str]]:
    """Return what is new in a status, as (text, tone)."""
    found: list[tuple[str, str]] = []
    if before is None or before.state != after.state:
        tone = BAD if after.state in TROUBLED else GOOD if after.state == "done" else PLAIN
        found.append((f"{after.state}: {after.reason}", tone))
    elif after.state in TROUBLED and before.reason != after.reason:
        found.append((f"{after.state}: {after.reason}", BAD))
    known = before.errors.by_code if before is not None else {}
    for code, count in after.errors.by_code.items():
        if more := count - known.get(code, 0):
            found.append((f"refused: {more} x {code}, {after.errors.last}", BAD))
    if after.ledger.fault and (before is None or before.ledger.fault != after.ledger.fault):
        found.append((f"ledger: {after.ledger.fault}", BAD))
    recorder = before.recorder.state if before is not None and before.recorder else ""
    if after.recorder and after.recorder.state != recorder:
        tone = PLAIN if after.recorder.state in ("recording", "starting") else BAD
        found.append((f"recorder {after.recorder.state}: {after.recorder.reason or ''}", tone))
    return found


# The daemon publishes a status once a second.
SILENCE_S = 3.5
# Without poses of their own on the native keys, those in the status are shown.
POSE_LASTS_S = 2.0


@dataclass(frozen=True, slots=True)
class Token:
    """A robot's daemon that has come (``here``) or gone."""

    robot: str
    here: bool


class RobotView:
    """The newest map, coverage, path, pose and status of one robot, and the latest events.

    Attributes:
        map, coverage: None before the first.
        field: the living trail, on the cells: 0 for none, else 1 to ``FIELD_LEVELS``; None as long
            as it is not asked for, and before the first.
        pose: where the robot is; None before the first pose.
        status: the newest one; None before the first.
        document: the same as it came, b"" before the first.
        walk: the path, and how far the robot is on it.
        robots: of all robots on the bus that have a daemon, the names.
        trouble: why the bus cannot be reached; "" where it can.
        gone_since: when the daemon went, since the epoch [s]; None while it is there,
            and before it ever was.
    """

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.events = EventLog()
        self.map: OccupancyGrid | None = None
        self.coverage: OccupancyGrid | None = None
        self.field: OccupancyGrid | None = None
        self.pose: Pose2D | None = None
        self.status: Status | None = None
        self.document = b""
        self.walk = PathProgress()
        self.robots: set[str] = set()
        self.trouble = ""
        self.gone_since: float | None = None
        self._reported_at = self._posed_at = float("-inf")
        self._malformed = 0
        self._readers: dict[str, Callable[[Sample, float], None]] = {
            "map": self._read_map,
            "map_update": self._read_map_update,
            "pose": self._read_pose,
            "path": self._read_path,
            "coverage": self._read_coverage,
            "pheromone": self._read_field,
            "status": self._read_status,
            "command": self._read_command,
        }

    @property
    def is_here(self) -> bool:
        """Whether the robot's daemon is on the bus."""
        return self.robot in self.robots

    @property
    def path_ahead(self) -> NDArray[np.float64]:
        """What is still to be driven, float64 (n, 2) [m], beginning where the robot is."""
        return self.walk.ahead(self.pose)

    def silent_s(self, now: float) -> float:
        """Return for how long a status of the daemon has been overdue [s]; 0 while none is."""
        silent = now - self._reported_at
        return silent if self.status is not None and silent > SILENCE_S else 0.0

    def take(self, topic: str, item: object, now: float) -> None:
        """Take in a sample of ``topic`` or a Token, which came ``now``, since the epoch [s].

        What cannot be read costs that sample, and is noted.
        """
        if isinstance(item, Token):
            self._note_token(item, now)
        elif isinstance(item, Sample):
            try:
                self._readers[topic](item, now)
            except FasacoError as error:
                self._malformed += 1
                # A faulty publisher is so with every message: note the 1st, 2nd, 4th, 8th ...
                if self._malformed & (self._malformed - 1) == 0:
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
            # It has not had the time to publish a status.
            self.gone_since, self._reported_at = None, now
            self.events.add(now, f"the daemon is {'back' if back else 'there'}", GOOD)

    def _read_map(self, sample: Sample, _: float) -> None:
        self.map = decode_occupancy_grid(sample.payload)

    def _read_map_update(self, sample: Sample, _: float) -> None:
        patch = decode_map_update(sample.payload)
        # Updates of a map that came before this process did are of no use to it.
        if self.map is not None:
            self.map = self.map.patched(patch)

    def _read_pose(self, sample: Sample, now: float) -> None:
        configured = known_settings(self.status.config).pose.schema if self.status else ""
        stamped = decode_pose(sample.payload, sample.schema or configured or POSE_STAMPED)
        self._posed_at = now
        self._move(stamped.pose)

    def _read_path(self, sample: Sample, now: float) -> None:
        about = decode_document(sample.attachment or b"{}", PathAttachment)
        self.walk = PathProgress(decode_path(sample.payload).xy, about.revision)
        steps = f"{about.steps} steps" if len(self.walk.xy) else "stop"
        self.events.add(now, f"path {about.revision}, {steps}: {about.reason}")

    def _read_coverage(self, sample: Sample, _: float) -> None:
        self.coverage = decode_occupancy_grid(sample.payload)

    def _read_field(self, sample: Sample, _: float) -> None:
        # Without an attachment it is what a cohort has left.
        if sample.attachment:
            message = decode_pheromone(sample.payload)
            levels = -(-message.levels.astype(np.int16) * FIELD_LEVELS // 255)
            self.field = OccupancyGrid(message.geometry, levels.astype(np.int8), message.frame)

    def _read_status(self, sample: Sample, now: float) -> None:
        status = decode_document(sample.payload, Status)
        if not status.state:
            raise MalformedMessage("status: it has no state")
        if status.claim.stand != "plans":
            # It may be a second daemon of this name: what that is like is not how the robot is.
            if status.claim.stand != "looks":
                self.events.add(now, f"a second daemon is {status.state}: {status.reason}", BAD)
            return
        for text, tone in differences(self.status, status):
            self.events.add(now, text, tone)
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
        document = decode_json(sample.payload)
        order = document.get("order")
        names = [str(zone["name"]) for zone in _zones(order)]
        about = f" with {', '.join(names)}" if names else ""
        self.events.add(now, f"command {document.get('command')}{about}", ORDER)

    def _move(self, pose: Pose2D) -> None:
        if abs(pose.x) <= MAX_COORDINATE_M and abs(pose.y) <= MAX_COORDINATE_M:
            self.pose = pose
            self.walk.passed(pose)


def _zones(order: object) -> list[dict[str, object]]:
    zones = order.get("zones") if isinstance(order, dict) else None
    found = zones if isinstance(zones, list) else []
    return [zone for zone in found if isinstance(zone, dict) and "name" in zone]


# Poses come more often than steps are driven: further ahead, a path may pass the place again.
LOOK_AHEAD_STEPS = 8


class PathProgress:
    """A path, and which of its points the robot is at.

    Attributes:
        xy: float64 (n, 2), points [m].
        revision: number of the path.
        at: index of the point the robot came to last.
    """

    def __init__(self, xy: NDArray[np.float64] | None = None, revision: int = 0) -> None:
        self.xy = np.zeros((0, 2)) if xy is None else xy
        self.revision = revision
        self.at = 0

    def left(self, steps: int) -> None:
        """Note how many steps are left, as the daemon says."""
        self.at = max(self.at, len(self.xy) - 1 - max(steps, 0))

    def passed(self, pose: Pose2D) -> None:
        """Note where the robot is; it goes forward only."""
        near = self.xy[self.at : self.at + LOOK_AHEAD_STEPS]
        if len(near) < 2:
            return
        step_m = float(np.hypot(*(near[1] - near[0])))
        away = np.hypot(near[:, 0] - pose.x, near[:, 1] - pose.y)
        closest = int(np.argmin(away))
        if away[closest] <= step_m:
            self.at += closest

    def ahead(self, pose: Pose2D | None) -> NDArray[np.float64]:
        """Return what is still to be driven, float64 (n, 2) [m], from the robot on."""
        rest = self.xy[self.at + 1 :]
        if not len(rest):
            return rest
        here = self.xy[self.at] if pose is None else np.array([pose.x, pose.y])
        return np.concatenate([here[None, :], rest])
