"""The page of a recording: for a requested time, it sends the messages of a live page."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.bus.queries import QueryReply
from fasaco_edge.client.robot_state import SILENCE_S
from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import DrawingPlace
from fasaco_edge.recording.read.timeline import DrawnLine, Timeline
from fasaco_edge.serve.messages import framed, message_text
from fasaco_edge.serve.served_view import MOST_POINTS, PERIODS_S, ServedView
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST, PathAttachment
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.grids import GridOctets
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.schemas import PATH

GRIDS = {"map": entities.MAP, "floor": entities.FLOOR, "field": entities.PHEROMONE}
# Converts the opacity of swept floor into percent.
PERCENT = bytes(min(round(100 * value / entities.SWEPT_OPACITY), 100) for value in range(256))
# Driven track: least distance of its points [m], limit on their number, and distance above which
# two points are a jump [m].
SPACING_M, MOST_TRACK, JUMP_M = 0.03, 50_000, 1.0
# Limit on the poses used to find the progress along a path.
MOST_POSES = 5_000


class RecordedView(ServedView):
    """The newest samples of a recorded robot at one time."""

    periods_s = dict.fromkeys(PERIODS_S, 0.0)

    def __init__(self, robot: str) -> None:
        super().__init__(Keys())
        self.robot, self.robots = robot, {robot}
        # Place in the recording of each grid shown.
        self._drawn: dict[str, DrawingPlace] = {}

    def silent_s(self, now: float) -> float:
        """Return the age of the newest status [s]; 0 if the next status is not yet overdue."""
        silent = super().silent_s(now)
        return silent if silent > entities.STATUS_PERIOD_S + SILENCE_S else 0.0

    @property
    def reported_at(self) -> float:
        """Arrival of the newest status, since the epoch [s]."""
        return self._reported_at

    def has(self) -> list[str]:
        """Return the kinds of messages that have content."""
        made = {"path": self._path, "pose": self.pose} | self._grids
        return [kind for kind, content in made.items() if content is not None]

    def draw(self, kind: str, place: DrawingPlace, timeline: Timeline) -> None:
        """Take in a drawn grid unless it is shown already; errors as for ``Timeline.grid``."""
        if self._drawn.get(kind) == place:
            return
        self._drawn[kind] = place
        grid = timeline.grid(place)
        octets = grid.pixels.tobytes()
        octets = octets.translate(PERCENT) if kind == "floor" else octets
        self._grids[kind] = GridOctets(grid.geometry, memoryview(octets), "")

    def follow(self, line: DrawnLine, attachment: bytes, now: float) -> None:
        """Take in a drawn path with its attachment."""
        about = decode_tolerant(attachment or b"{}", PathAttachment)
        xy = stepped(line.xy, min(about.steps, MOST_POINTS - 1))
        try:
            payload = encode_path(xy, np.zeros(len(xy)), "map", 0)
        except FasacoError as error:
            self.note_unreadable("path", error, now)
        else:
            self.take("path", Sample("", payload, PATH, attachment), now)

    def drive(self, poses: NDArray[np.float64], now: float) -> None:
        """Move the robot along poses, float64 (n, 3): x, y [m], yaw [rad]; the last one is now."""
        self._posed_at = now
        for x, y, yaw in poses.tolist():
            self._move(Pose2D(x, y, yaw))


class Playback:
    """A recording as the source of one viewer, who can seek in it.

    Args:
        timeline: the recording.
        paths: files of the recording.
    """

    def __init__(self, timeline: Timeline, paths: Sequence[Path]) -> None:
        self._timeline = timeline
        self._paths = paths
        robots = (_robot_of(one.sample) for one in timeline.samples if one.topic == "status")
        self._robot = next(filter(None, robots), "robot")
        self._rewind()

    def _rewind(self) -> None:
        self._view = RecordedView(self._robot)
        self._at_ns = 0
        self._path: DrawingPlace | None = None
        self._abouts: dict[int, bytes] = {}

    def newest(self) -> list[tuple[str, int, str | bytes]]:
        """Return the messages about the whole recording: its description and the driven track."""
        clock, names = self._timeline.clock, [path.name for path in self._paths]
        began_s, seconds = 1e-9 * clock.began_ns, clock.seconds(self._timeline.ended_ns)
        about = {"files": names[:2], "began_s": began_s, "seconds": seconds, "clock": clock.words}
        text = message_text("recording", **about)
        return [("recording", 1, text), ("track", 1, track_message(self._timeline))]

    def ask(self, query: str, payload: bytes, timeout_s: float) -> list[QueryReply]:
        """Return nothing: there is no daemon to ask."""
        return []

    def at(self, at_s: float) -> list[str | bytes]:
        """Return the messages that differ between the time shown so far and ``at_s``.

        ``at_s``: the robot's time since the recording began [s].

        Raises:
            UnreadableRecording: a file can no longer be read.
        """
        timeline, clock = self._timeline, self._timeline.clock
        at_s = min(max(at_s, 0.0), clock.seconds(timeline.ended_ns))
        at_ns = clock.wall_ns(at_s)
        if at_ns < self._at_ns:
            self._rewind()
        view, now, since_ns, self._at_ns = self._view, 1e-9 * at_ns, self._at_ns, at_ns
        self._take(timeline.samples_between(since_ns, at_ns))
        for kind, entity in GRIDS.items():
            if (place := timeline.newest(entity, at_ns)) is not None:
                view.draw(kind, place, timeline)
        found = {}
        path = timeline.newest(entities.PATH, at_ns)
        if path is not None and path != self._path:
            self._path, since_ns = path, path.at_ns
            line = timeline.line(path)
            view.follow(line, self._abouts.get(line.revision, b""), now)
            # Making the path's message sets the path along which later poses move the robot.
            found = view.news(now)
        poses = timeline.poses_between(since_ns, at_ns)
        view.drive(poses[:: -(-len(poses) // MOST_POSES) or 1], now)
        view.drive(timeline.poses_between(0, at_ns)[-1:], now)
        found |= view.news(now)
        reported_s = None
        if view.status:
            reported_s = round(clock.seconds(round(1e9 * view.reported_at)), 3)
        ending = message_text("time", at=at_s, has=view.has(), status=reported_s)
        return [*found.values(), ending]

    def _take(self, arrivals: Sequence[Arrival]) -> None:
        for one in arrivals:
            if one.topic == PATH_DIGEST:
                about = decode_tolerant(one.sample.attachment or b"{}", PathAttachment)
                self._abouts[about.revision] = one.sample.attachment
            else:
                self._view.take(one.topic, one.sample, 1e-9 * one.wall_ns)


def _robot_of(sample: Sample) -> str:
    try:
        return decode_tolerant(sample.payload, Status).robot
    except FasacoError:
        return ""


def stepped(corners: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Return a path of at most ``steps`` equal steps through ``corners``, float64 (k, 2) [m].

    A recording has the corners of a path only.
    """
    ways = np.diff(corners, axis=0)
    lengths = np.hypot(*ways.T) if len(ways) else np.zeros(0)
    # The encoder refuses an invalid line.
    if len(lengths) >= steps or not np.isfinite(lengths).all():
        return corners

    def pieces_of(step_m: float) -> NDArray[np.int64]:
        return np.maximum(np.rint(lengths / step_m), 1.0).astype(np.int64)

    # Bisection for the least length of a step that gives at most ``steps`` steps.
    least, most = 0.0, float(lengths.sum()) or 1.0
    for _ in range(50):
        step_m = (least + most) / 2
        least, most = (step_m, most) if pieces_of(step_m).sum() > steps else (least, step_m)
    pieces = pieces_of(most)
    first = np.cumsum(pieces) - pieces
    along = (np.arange(pieces.sum()) - np.repeat(first, pieces)) / np.repeat(pieces, pieces)
    between = np.repeat(corners[:-1], pieces, axis=0) + along[:, None] * np.repeat(ways, pieces, 0)
    return np.vstack([between, corners[-1:]])


def track_message(timeline: Timeline) -> bytes:
    """Return the driven track as a message: points (x, y) [m], and their times [s]."""
    poses, at_s = timeline.poses, timeline.clock.all_seconds(timeline.pose_ns)
    ways = np.hypot(*np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]).T)
    kept = np.diff(np.floor(np.cumsum(ways) / SPACING_M), prepend=-1.0) > 0
    points = np.column_stack((poses[:, :2], at_s))[kept]
    points = points[:: -(-len(points) // MOST_TRACK) or 1]
    x, y = points[0, :2].tolist() if len(points) else (0.0, 0.0)
    body = (points - (x, y, 0.0)).astype("<f4").tobytes()
    return framed("track", {"x": x, "y": y, "jump": JUMP_M}, zlib.compress(body, 1))
