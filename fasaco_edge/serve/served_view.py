"""The page's view of a robot, which makes messages for browsers from its newest samples."""

from __future__ import annotations

import sys
import zlib
from array import array
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.robot_state import RobotState, WatchedPath
from fasaco_edge.errors import FasacoError
from fasaco_edge.serve.digest import areas, lately, rooms, shares, state
from fasaco_edge.serve.messages import (
    COVERAGE_MARKS,
    FIELD_MARKS,
    FLOOR_MARKS,
    UNSWEPT_MARKS,
    framed,
    grid_message,
    map_marks,
    message_text,
)
from fasaco_edge.wire.documents.fleet import decode_member
from fasaco_edge.wire.documents.json_text import decode_document
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.replies import MissionReport
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.grids import GridOctets, read_field, read_grid, with_update
from fasaco_edge.wire.messages.path_points import PathPoints

# Limit on the points shown of a path; reading a point takes about 4 us.
MOST_POINTS = 20_000
# Limit on the number of other robots shown, and on the age of their positions [s]; each robot
# publishes once a second.
MOST_OTHERS, OTHER_LASTS_S = 50, 10.0
# Topics of occupancy grids.
GRIDS = ("map", "coverage", "floor", "unswept")
# Least period of each message [s]; unchanged messages are not sent again.
PERIODS_S = {
    "pose": 0.1,
    "state": 0.2,
    "path": 0.2,
    "areas": 0.5,
    "rooms": 0.5,
    "shares": 0.5,
    "events": 0.5,
    "map": 0.5,
    "floor": 1.0,
    "unswept": 1.0,
    "field": 1.0,
    "others": 1.0,
}


class ServedView(RobotState):
    """The newest samples of one robot; grids stay bytes.

    Attributes:
        periods_s: least period of each message [s].
    """

    periods_s: Mapping[str, float] = PERIODS_S

    def __init__(self, keys: Keys) -> None:
        super().__init__(keys.robot)
        self._keys = keys
        self._grids: dict[str, GridOctets] = {}
        # The newest order given by command, kept after its end.
        self._last_order: dict[str, object] | None = None
        self._others: dict[str, tuple[float, float, float]] = {}
        self._path: Sample | None = None
        # The newest path that is not empty: a paused robot continues on it.
        self._to_drive: Sample | None = None
        # The newest status with an order: unswept floor is shown after the order's end, too.
        self._ordered: Status | None = None
        self._readers |= {
            **{kind: partial(self._read_grid, kind) for kind in GRIDS},
            "map_update": self._read_map_update,
            "pheromone": self._read_field,
            "path": self._read_path,
            "fleet": self._read_fleet,
        }
        self._makers: dict[str, Callable[[float], str | bytes | None]] = {
            # The path comes first: progress and remaining time refer to it.
            "path": self._path_message,
            "pose": lambda _: self._pose_message(),
            "state": lambda now: message_text(
                "state", **state(self, now, self._ordered, self._last_order)
            ),
            "areas": lambda _: message_text("areas", **areas(self.settings, self._mission)),
            "rooms": lambda _: message_text("rooms", **rooms(self.rooms)),
            "shares": lambda _: message_text("shares", **shares(self.rooms)),
            "events": lambda _: message_text("events", entries=lately(self.events)),
            "map": lambda _: self._map_message(),
            "floor": lambda _: self._grid_message("floor", FLOOR_MARKS),
            "unswept": lambda _: self._grid_message("unswept", UNSWEPT_MARKS),
            "field": lambda _: self._grid_message("field", FIELD_MARKS),
            "others": lambda now: message_text("others", robots=list(self._near(now))),
        }
        self._made_at = dict.fromkeys(self._makers, float("-inf"))
        # What the newest message of each kind was made from.
        self._made_of: dict[str, object] = {}
        self._sent: dict[str, str] = {}

    def news(self, now: float) -> dict[str, str | bytes]:
        """Return the due and changed messages by kind."""
        found: dict[str, str | bytes] = {}
        for kind, make in self._makers.items():
            if now - self._made_at[kind] < self.periods_s[kind] or not self._is_new(kind, now):
                continue
            self._made_at[kind] = now
            message = make(now)
            if message is not None and message != self._sent.get(kind):
                if isinstance(message, str):
                    self._sent[kind] = message
                found[kind] = message
        return found

    def _is_new(self, kind: str, now: float) -> bool:
        source = self._source(kind, now)
        if kind in self._made_of and self._made_of[kind] == source:
            return False
        self._made_of[kind] = source
        return True

    def _source(self, kind: str, now: float) -> object:
        """Return what a message is made from: equal sources make equal messages."""
        made_of: dict[str, object] = {
            "pose": (self.pose, self.walk, self.walk.at),
            "path": self._shown_path,
            "events": self.events.count,
            "areas": (self.settings, self._mission.zones, self._mission.keep_outs),
            "rooms": (self.rooms,),
            "shares": (self.rooms,),
            "map": (self._grids.get("map", self._grids.get("coverage")), self.settings.map),
            "floor": self._grids.get("floor"),
            "unswept": self._grids.get("unswept"),
            "field": self._grids.get("field"),
        }
        # The other kinds depend on all of these.
        now_too = self.document, self.trouble, len(self.robots), self.walk, int(now)
        return made_of.get(kind, now_too)

    @property
    def _mission(self) -> MissionReport:
        return self.status.mission if self.status else MissionReport()

    def _read_status(self, sample: Sample, now: float) -> None:
        super()._read_status(sample, now)
        if self.status is not None and self.status.mission.ordered is not None:
            self._ordered = self.status

    def _read_grid(self, kind: str, sample: Sample, _: float) -> None:
        self._grids[kind] = read_grid(sample.payload)

    def _read_map_update(self, sample: Sample, _: float) -> None:
        # An update is of no use without its map, which came before this process started.
        if "map" in self._grids:
            self._grids["map"] = with_update(self._grids["map"], sample.payload)

    def _read_field(self, sample: Sample, _: float) -> None:
        self._grids["field"] = read_field(sample.payload)

    @property
    def _shown_path(self) -> Sample | None:
        """The newest path; for a paused robot, whose path is empty, the path before the pause."""
        is_paused = self.status is not None and self.status.state == "paused"
        is_stopped = self._path is not self._to_drive
        return self._to_drive or self._path if is_paused and is_stopped else self._path

    def _read_path(self, sample: Sample, _: float) -> None:
        # A path makes no event, as paths are frequent.
        about = decode_document(sample.attachment or b"{}", PathAttachment)
        leads_on = PathPoints(sample.payload).left > 0
        self._path = sample
        if leads_on:
            self._to_drive = sample
        elif not about.revision:  # the daemon has restarted, and has no path to continue on
            self._to_drive = None

    def _read_fleet(self, sample: Sample, now: float) -> None:
        robot = self._keys.robot_of(sample.key)
        fleet = self.status.fleet if self.status else None
        if fleet is None or robot in ("", self.robot):
            return
        member = decode_member(sample.payload, fleet.name)
        if member is not None and (robot in self._others or len(self._others) < MOST_OTHERS):
            self._others[robot] = (now, member.x, member.y)

    def _follow(self, document: dict[str, object], now: float) -> None:
        super()._follow(document, now)
        if document.get("command") == "start":
            order = document.get("order")
            self._last_order = order if isinstance(order, dict) else {}

    def _near(self, now: float) -> Iterator[dict[str, object]]:
        for robot, (at_s, x, y) in list(self._others.items()):
            if now - at_s > OTHER_LASTS_S:
                del self._others[robot]
            else:
                yield {"name": robot, "x": x, "y": y}

    def _pose_message(self) -> str | None:
        if self.pose is None:
            return None
        x, y, yaw = (round(value, 3) for value in (self.pose.x, self.pose.y, self.pose.yaw))
        return message_text("pose", x=x, y=y, yaw=yaw, at=self.walk.at, path=self.walk.revision)

    def _path_message(self, now: float) -> bytes | None:
        sample = self._shown_path
        if sample is None:
            return None
        try:
            about = decode_document(sample.attachment or b"{}", PathAttachment)
            points = PathPoints(sample.payload)
            xy = points.take(MOST_POINTS)
        except FasacoError as error:
            self.note_unreadable("path", error, now)
            return None
        self.walk = WatchedPath(xy, about.revision)
        if self.pose is not None:
            self.walk.join(self.pose)
        # Relative to the first point, as float32 does not resolve centimetres far from 0.
        x, y = xy[0] if xy else (0.0, 0.0)
        flat = array("f", (value for px, py in xy for value in (px - x, py - y)))
        if sys.byteorder == "big":
            flat.byteswap()
        head: dict[str, object] = {"revision": about.revision, "x": x, "y": y, "more": points.left}
        return framed("path", head, zlib.compress(flat.tobytes(), 1))

    def _map_message(self) -> bytes | None:
        if "map" in self._grids:
            return grid_message("map", self._grids["map"], map_marks(self.settings.map))
        # Without a map, as under ROS 2, the coverage lattice shows free floor.
        cells = self._grids.get("coverage")
        return None if cells is None else grid_message("map", cells, COVERAGE_MARKS)

    def _grid_message(self, kind: str, marks: bytes) -> bytes | None:
        grid = self._grids.get(kind)
        return None if grid is None else grid_message(kind, grid, marks)
