"""Legal messages in senseless orders: a stream of events from one seed.

The generator knows what an honest robot would do - a map that grows, poses on the walk, an order
carried out - and does that part of the time; else it does what nobody would: it jumps, turns maps
about, gives orders in the wrong state, stands at every limit and one ulp beyond. Events are plain
documents, so that a list of them can be kept as JSON and played again.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import FARTHEST_M
from fasaco_edge.mission.orders.order import MOST_KEEP_OUT, MOST_ZONES
from fasaco_edge.planners.passes import MOST_PASSES
from fasaco_edge.planners.registry import PLANNER_NAMES
from fasaco_edge.wire.limits import (
    MAX_COORDINATE_M,
    MAX_RESOLUTION_M,
    MAX_STRING_BYTES,
    MIN_RESOLUTION_M,
)

Event = dict[str, Any]
Pixels = NDArray[np.int8]

FREE, WALL, UNKNOWN = 0, 100, -1
HONEST_FRAME = "map"
FRAMES = ("odom", "", "x" * MAX_STRING_BYTES, "地図", "\u202e\x1b[2J", "map\n")
KEEP_OUTS = ("keep_out_add", "keep_out_remove")
ROOMS = ("room_name", "room_split", "room_merge", "room_set")
PLAIN = ("pause", "resume", "home", "cancel", "reset", "replan", "status")
COMMANDS = (*PLAIN, *KEEP_OUTS, *ROOMS)
QUERIES = (
    *("path", "status", "coverage", "pheromone", "rooms", "config", "version", "mission"),
    *("replan", "*"),
)
# Times that a stamp can be near: the epoch, today, and both ends of an int32 of seconds.
EPOCHS = (1, 1_750_000_000 * 10**9, -(2**31) * 10**9, (2**31 - 10**4) * 10**9)
# Events that are no message: they pass the time, or look whether all is well.
SILENT = ("wait", "checkpoint")


class Senseless:
    """An endless stream of events.

    Args:
        seed: of everything.
        most_pixels: of one map.
        check_every, restart_every, reload_every: events between two of those.
    """

    def __init__(
        self,
        seed: int,
        most_pixels: int = 1_000_000,
        check_every: int = 4_000,
        restart_every: int = 9_000,
        reload_every: int = 3_500,
    ) -> None:
        self._rng = random.Random(seed)
        self._most_pixels = most_pixels
        self._every = {
            "checkpoint": check_every,
            "restart": restart_every,
            "reload": reload_every,
        }
        self._serial = 0
        self._map: Event = self._honest_map()
        self._x = self._y = 1.0
        self._acts: list[tuple[int, Callable[[], Iterator[Event]]]] = [
            (10, self._behave),
            (30, self._drive),
            (12, self._wander),
            (10, self._jump),
            (4, self._stand_at_limits),
            (3, self._speak_of_other_frames),
            (3, self._transforms),
            (6, self._grow),
            (8, self._another_map),
            (2, self._map_at_limits),
            (8, self._updates),
            (3, self._misfitting_updates),
            (9, self._command),
            (6, self._ask),
            (3, self._keep_silent),
            (1, self._come_and_go),
            (2, self._mask),
            (1, self._flood),
        ]

    def __iter__(self) -> Iterator[Event]:
        """Yield events without end."""
        count, due = 0, dict(self._every)
        weights, acts = zip(*self._acts, strict=True)
        while True:
            (act,) = self._rng.choices(acts, weights)
            for event in act():
                yield event
                count += event["do"] not in SILENT
            for name, make in self._interludes().items():
                if count >= due[name]:
                    due[name] = count + self._every[name]
                    yield from make()

    def _interludes(self) -> dict[str, Callable[[], Iterator[Event]]]:
        return {
            "reload": lambda: iter([{"do": "reload", "sections": self._changeable()}]),
            "restart": self._restart,
            "checkpoint": lambda: iter([{"do": "checkpoint", "map": self._honest_map()}]),
        }

    # Poses.

    def _behave(self) -> Iterator[Event]:
        """Do for a while what a robot should."""
        yield {"do": "command", "document": {"command": "start", "discard": True}}
        yield self._show(self._honest_map())
        yield self._pose(1.0, 1.0)
        for _ in range(self._rng.randint(1, 4)):
            yield {"do": "wait", "s": 0.15}
            yield from self._drive()
            yield self._show(self._map | {"stamp": self._stamp(), "seed": self._map["seed"] + 1})

    def _drive(self) -> Iterator[Event]:
        """Follow the path that was published, cell by cell."""
        for _ in range(self._rng.randint(10, 120)):
            yield {"do": "drive", "off": self._rng.choice([0.0, 0.0, 0.05, 0.14])}

    def _wander(self) -> Iterator[Event]:
        step = self._rng.choice([0.01, 0.1, 0.4])
        for _ in range(self._rng.randint(10, 100)):
            self._x += self._rng.uniform(-step, step)
            self._y += self._rng.uniform(-step, step)
            yield self._pose(self._x, self._y)

    def _jump(self) -> Iterator[Event]:
        """Be anywhere: on the map, at its rim, beside it."""
        for _ in range(self._rng.randint(1, 60)):
            u, v = (self._rng.choice([self._rng.random(), 0.0, 1.0, 1.2, -0.1]) for _ in range(2))
            self._x, self._y = _point_on(self._map, u, v)
            yield self._pose(self._x, self._y)

    def _stand_at_limits(self) -> Iterator[Event]:
        for _ in range(self._rng.randint(1, 20)):
            x, y = (self._rng.choice(_around(MAX_COORDINATE_M)) for _ in range(2))
            yield self._pose(x, self._rng.choice([y, self._y]))
        self._x, self._y = _point_on(self._map, 0.5, 0.5)

    def _speak_of_other_frames(self) -> Iterator[Event]:
        frame = self._rng.choice(FRAMES)
        for _ in range(self._rng.randint(1, 40)):
            yield self._pose(self._x, self._y) | {"frame": frame}

    def _transforms(self) -> Iterator[Event]:
        """Return links of a chain; now and then one that hangs on itself, or one too many."""
        for _ in range(self._rng.randint(1, 60)):
            frame, child = self._rng.choice(
                [("map", "odom"), ("odom", "base_link"), ("odom", "base_link")] * 6
                + [("base_link", "odom"), ("odom", "odom"), ("map", f"f{self._rng.random()}")]
            )
            yield {
                "do": "tf",
                "frame": frame,
                "child": child,
                "static": self._rng.random() < 0.1,
                **self._place(self._x, self._y),
            }

    def _pose(self, x: float, y: float) -> Event:
        kind = self._rng.choice(["PoseStamped"] * 8 + ["PoseWithCovarianceStamped", "Odometry"])
        return {"do": "pose", "type": kind, "frame": HONEST_FRAME, **self._place(x, y)}

    def _place(self, x: float, y: float) -> Event:
        stamp = self._stamp() if self._rng.random() < 0.1 else 1
        return {"x": x, "y": y, "yaw": self._rng.uniform(-7.0, 7.0), "stamp": stamp}

    # Maps.

    def _honest_map(self) -> Event:
        rows, cols = self._rng.randint(60, 160), self._rng.randint(60, 160)
        return self._map_event(rows, cols, 0.05, "rooms") | {"x": 0.0, "y": 0.0, "yaw": 0.0}

    def _map_event(self, rows: int, cols: int, resolution: float, kind: str) -> Event:
        return {
            "do": "map",
            "rows": rows,
            "cols": cols,
            "resolution": resolution,
            "x": 0.0,
            "y": 0.0,
            "yaw": 0.0,
            "frame": HONEST_FRAME,
            "stamp": self._stamp(),
            "kind": kind,
            "seed": self._rng.randrange(2**32),
            "topic": self._rng.choice(["map"] * 9 + ["ros_map"]),
        }

    def _grow(self) -> Iterator[Event]:
        """Show the same building again: more of it, moved by a little, or as it was."""
        for _ in range(self._rng.randint(1, 6)):
            before = self._map
            pixel = before["resolution"]
            rows = max(1, before["rows"] + self._rng.choice([0, 0, 3, 20, -5]))
            cols = max(1, before["cols"] + self._rng.choice([0, 0, 3, 20, -5]))
            if rows * cols > self._most_pixels:
                rows, cols = before["rows"], before["cols"]
            moved = self._rng.choice([0.0, 0.0, pixel, -7 * pixel, pixel / 3, 1e-4])
            turned = self._rng.choice([0.0] * 6 + [1e-9, 0.02])
            yield self._show(
                before
                | {"rows": rows, "cols": cols, "x": before["x"] + moved, "stamp": self._stamp()}
                | {"yaw": before["yaw"] + turned}
            )
            yield self._pose(*_point_on(self._map, 0.5, 0.5))

    def _another_map(self) -> Iterator[Event]:
        sides = [1, 2, 3, 17, 60, 120, 300]
        rows, cols = (self._rng.choice(sides) for _ in range(2))
        if self._rng.random() < 0.1:
            rows = cols = math.isqrt(self._most_pixels)
        resolution = self._rng.choice([0.05] * 6 + [0.1, 0.02, 0.3, 0.025])
        event = self._map_event(rows, cols, resolution, self._rng.choice(list(CONTENTS)))
        event["x"], event["y"] = (
            self._rng.choice([0.0, 0.0, -3.0, self._rng.uniform(-9, 9), 5e5]) for _ in range(2)
        )
        event["yaw"] = self._rng.choice([0.0, 0.0, 1e-9, 0.3, math.pi, -math.pi, math.pi / 2])
        if self._rng.random() < 0.05:
            event["frame"] = self._rng.choice(FRAMES)
        yield self._show(event)
        yield from self._jump()

    def _map_at_limits(self) -> Iterator[Event]:
        """Put corner and resolution to their limits, one ulp inside and one beyond."""
        rows, cols = (self._rng.choice([1, 2, 50, 100, 300]) for _ in range(2))
        finest, coarsest = (
            [float(value) for value in _around32(limit)]
            for limit in (MIN_RESOLUTION_M, MAX_RESOLUTION_M)
        )
        resolution = self._rng.choice([0.05] * 6 + finest + coarsest)
        event = self._map_event(rows, cols, resolution, self._rng.choice(list(CONTENTS)))
        corners = _around(MAX_COORDINATE_M)
        span = max(rows, cols) * resolution
        corners += [limit - span for limit in corners if limit > 0]
        event["x"] = self._rng.choice([*corners, 0.0])
        event["y"] = self._rng.choice([*corners, event["x"]])
        event["yaw"] = self._rng.choice([0.0, 0.3, math.pi, math.nextafter(math.pi, 4.0)])
        yield self._show(event)
        for _ in range(self._rng.randint(1, 10)):
            yield self._pose(*_point_on(event, self._rng.random(), self._rng.random()))
        yield {"do": "wait", "s": self._rng.choice([0.02, 0.2])}
        yield from self._drive()

    def _show(self, event: Event) -> Event:
        self._map = event
        self._x, self._y = _point_on(event, 0.5, 0.5)
        return event

    def _updates(self) -> Iterator[Event]:
        """Change rectangles of the map there is."""
        rows, cols = self._map["rows"], self._map["cols"]
        for _ in range(self._rng.randint(1, 40)):
            high = min(rows, self._rng.choice([1, 2, 9, 40]))
            wide = min(cols, self._rng.choice([1, 2, 9, 40]))
            row, col = self._rng.randint(0, rows - high), self._rng.randint(0, cols - wide)
            yield self._update(row, col, high, wide)
            if self._rng.random() < 0.3:
                yield {"do": "drive", "off": 0.0}

    def _misfitting_updates(self) -> Iterator[Event]:
        rows, cols = self._map["rows"], self._map["cols"]
        corners = [-(2**31), -3, -1, 0, rows - 1, cols, cols + 1, 2**31 - 1]
        for _ in range(self._rng.randint(1, 30)):
            row, col = (self._rng.choice(corners) for _ in range(2))
            high, wide = (self._rng.choice([1, 2, rows, cols, 60]) for _ in range(2))
            yield self._update(row, col, min(high, 2_000), min(wide, 2_000))

    def _update(self, row: int, col: int, rows: int, cols: int) -> Event:
        frame = self._map["frame"] if self._rng.random() < 0.95 else self._rng.choice(FRAMES)
        return {
            "do": "update",
            "row": row,
            "col": col,
            "rows": rows,
            "cols": cols,
            "value": self._rng.choice([FREE, FREE, WALL, UNKNOWN, 40]),
            "frame": frame,
            "stamp": self._stamp(),
        }

    # Commands and questions.

    def _command(self) -> Iterator[Event]:
        for _ in range(self._rng.randint(1, 8)):
            command = self._rng.choice([*COMMANDS, "start", "start", "start"])
            document: Event = {"command": command}
            if command in ("start", "reset"):
                document["discard"] = self._rng.random() < 0.8
            if command in KEEP_OUTS:
                polygon = {"polygon": self._polygon()} if command == "keep_out_add" else {}
                document["keep_out"] = {"name": f"k{self._rng.randint(1, 4)}", **polygon}
            if command in ROOMS:
                document["room"] = {"id": self._room(), **self._change_of(command)}
            if command == "start" and self._rng.random() < 0.8:
                document["order"] = self._order()
            yield {"do": "command", "document": document}
            yield {"do": "drive", "off": 0.0}

    def _order(self) -> Event:
        limit = self._rng.random() < 0.05
        zones = MOST_ZONES if limit else self._rng.choice([0, 0, 1, 2, 3])
        keep_out = MOST_KEEP_OUT if limit else self._rng.choice([0, 0, 1, 2])
        return {
            "zones": [
                {"name": f"zone {number}", "polygon": self._polygon()}
                | ({"passes": self._rng.choice([1, 2, MOST_PASSES])} if number % 2 else {})
                | ({"priority": self._rng.choice([0, 50, 100, 101])} if number % 3 else {})
                for number in range(zones + limit * self._rng.randint(0, 1))
            ]
            + ([{"name": str(self._room())}] if self._rng.random() < 0.3 else []),
            "unknown": self._rng.choice(["refuse", "wait"]),
            "keep_out": [self._polygon() for _ in range(keep_out)],
            "passes": self._rng.choice([1] * 6 + [2, MOST_PASSES, MOST_PASSES + 1]),
            "return_home": self._rng.random() < 0.5,
            "keep_covered": self._rng.random() < 0.5,
            "until_min": self._rng.choice([None, None, 0.0, 0.05, 5.0, 1440.0, 1441.0]),
        }

    def _room(self) -> int | str:
        """Return a number or a name that a room may have."""
        number = self._rng.randint(1, 6)
        return self._rng.choice([number, number, f"room {number}", f"r{number}"])

    def _change_of(self, command: str) -> Event:
        """Return what a command about a room is to change."""
        if command == "room_split":
            u, v, to_u, to_v = (self._rng.uniform(-0.2, 1.2) for _ in range(4))
            return {"cut": [list(_point_on(self._map, *at)) for at in ((u, v), (to_u, to_v))]}
        if command == "room_merge":
            return {"others": [self._room() for _ in range(self._rng.randint(1, 3))]}
        if command == "room_set":
            passes = self._rng.choice([1, 2, ["edge", "rest"], ["auto", "cross"]])
            priority = self._rng.choice([None, 0, 60, 100, 101])
            return {"passes": passes, "skip": self._rng.random() < 0.3, "priority": priority}
        return {"name": f"r{self._rng.randint(1, 6)}"}

    def _polygon(self) -> list[list[float]]:
        """Return a polygon on the map or beside it; now and then one as wide as may be."""
        if self._rng.random() < 0.02:
            far = self._rng.choice(_around(FARTHEST_M / math.sqrt(2.0)))
            return [[-far, -far], [far, -far], [far, far]]
        x, y = _point_on(self._map, self._rng.uniform(-0.2, 1.2), self._rng.uniform(-0.2, 1.2))
        radius = self._rng.choice([0.05, 0.5, 1.0, 4.0])
        corners, ahead = self._rng.choice([3, 4, 7, 40]), self._rng.random()
        turns = [math.tau * (corner + ahead) / corners for corner in range(corners)]
        return [[x + radius * math.cos(turn), y + radius * math.sin(turn)] for turn in turns]

    def _near_polygons(self) -> list[list[list[float]]]:
        """Return keep-out zones of a configuration: with one out of bounds none would start."""
        polygons = [self._polygon() for _ in range(self._rng.choice([0, 0, 1, 3]))]
        return [each for each in polygons if np.abs(each).max() < MAX_COORDINATE_M / 2]

    def _ask(self) -> Iterator[Event]:
        for _ in range(self._rng.randint(1, 12)):
            name = self._rng.choice(QUERIES)
            parameters = ""
            if name == "pheromone" or self._rng.random() < 0.05:
                parameters = self._rng.choice(["", "cohort=0", "what=1"])
            yield {"do": "ask", "name": name, "parameters": parameters}

    # What happens to processes and links.

    def _keep_silent(self) -> Iterator[Event]:
        yield {"do": "wait", "s": self._rng.choice([0.02, 0.05, 0.05, 0.3, 0.3, 1.2])}

    def _come_and_go(self) -> Iterator[Event]:
        """Let the mapper be another one, whose latched map stands, or goes with it."""
        yield {"do": "publisher", "stays": self._rng.random() < 0.7}
        yield self._map | {"stamp": self._stamp(), "topic": "map"}

    def _mask(self) -> Iterator[Event]:
        """Draw keep-out zones over the map while the robot drives, and take them away."""
        for kind in (self._rng.choice(["rooms", "checkers", "noise"]), "free"):
            yield self._map | {"do": "mask", "stamp": self._stamp(), "kind": kind}
            yield from self._drive()

    def _flood(self) -> Iterator[Event]:
        """Say one thing again and again, oftener than anybody listens."""
        what = self._rng.choice(["map", "update", "pose", "command"])
        if what == "map":
            for _ in range(40):
                yield self._map
        elif what == "update":
            for _ in range(400):
                yield self._update(0, 0, 1, 1)
        elif what == "pose":
            for number in range(1_500):
                yield self._pose(self._x + 1e-3 * number, self._y) | {"type": "PoseStamped"}
        else:
            for _ in range(40):
                yield {"do": "command", "document": {"command": self._rng.choice(PLAIN)}}

    def _restart(self) -> Iterator[Event]:
        """End the daemon and start another one; the maps that are latched stand meanwhile."""
        yield from self._rng.choice([self._behave, self._another_map, self._map_at_limits])()
        sections = self._changeable()
        sections["robot"] |= {
            "tool_width_m": self._rng.choice([0.3] * 6 + [0.1, 0.5, 1.0]),
            "radius_m": self._rng.choice([0.18] * 4 + [0.05, 0.6]),
        }
        sections["mission"]["autostart"] = self._rng.random() < 0.8
        ros = {"kind": self._rng.choice(["bridge", "rmw_zenoh"]), "pose": "tf"}
        yield {
            "do": "restart",
            "kill": self._rng.random() < 0.5,
            "fresh": self._rng.random() < 0.1,
            "mode": self._rng.choice(["client", "peer"]),
            "masks": self._rng.random() < 0.5,
            "sections": sections | ({"ros2": ros} if self._rng.random() < 0.3 else {}),
        }

    def _changeable(self) -> Event:
        """Return sections of configuration that a reload can take up."""
        return {
            "planner": {
                "name": self._rng.choice([*["colony-search"] * 6, *PLANNER_NAMES]),
                "spare_share": self._rng.choice([0.0, 0.05]),
                "seed": self._rng.randrange(2**63),
                "budget_s": self._rng.choice([0.02, 0.1]),
                "line": self._rng.choice(["thorough", "thorough", "quick", "cells"]),
            },
            "map": {"free_at_most": self._rng.choice([25] * 6 + [0, 45])},
            "robot": {"quarter_turn_s": self._rng.choice([1.5, 0.0])},
            "mission": {
                "retries": self._rng.choice([0, 2]),
                "by_room": self._rng.choice(["never", "auto", "always"]),
                "retry_s": self._rng.choice([0.2, 30.0]),
                "lost_pose_s": self._rng.choice([0.0, 1.0, 3.0]),
                "stale_map_s": self._rng.choice([0.0, 0.0, 2.0]),
                "until_min": self._rng.choice([0.0, 0.0, 0.1, 60.0]),
                "keep_out": self._near_polygons(),
            },
        }

    def _stamp(self) -> int:
        """Return a time that no message had before [ns]: it says which map a path is on."""
        self._serial += 1
        return self._rng.choice(EPOCHS) + self._serial


def _around(limit: float) -> list[float]:
    """Return a limit of both signs, the last number inside it and the first one beyond."""
    numbers = [math.nextafter(limit, 0.0), limit, math.nextafter(limit, math.inf)]
    return [sign * number for sign in (1.0, -1.0) for number in numbers]


def _around32(limit: float) -> list[np.float32]:
    """Return a limit in single precision, and the numbers below and above."""
    middle = np.float32(limit)
    return [np.nextafter(middle, np.float32(0)), middle, np.nextafter(middle, np.float32(1e9))]


def _point_on(event: Event, u: float, v: float) -> tuple[float, float]:
    """Return the point (x, y) [m] at these shares of a map's width and height."""
    along = u * event["cols"] * event["resolution"], v * event["rows"] * event["resolution"]
    cos, sin = math.cos(event["yaw"]), math.sin(event["yaw"])
    return (
        event["x"] + cos * along[0] - sin * along[1],
        event["y"] + sin * along[0] + cos * along[1],
    )


# What a map shows: int8 (rows, cols) from a random generator.


def pixels_of(event: Event) -> Pixels:
    """Return the pixels of the map that an event describes."""
    rng = np.random.default_rng(event["seed"])
    return CONTENTS[event["kind"]](rng, event["rows"], event["cols"])


def _rooms(rng: np.random.Generator, rows: int, cols: int) -> Pixels:
    """Return a walled room with a wall across that has a door, and some pillars."""
    pixels = np.zeros((rows, cols), np.int8)
    pixels[[0, -1]] = WALL
    pixels[:, [0, -1]] = WALL
    if rows > 50 and cols > 50:
        pixels[:, cols // 2] = WALL
        pixels[15:40, cols // 2] = FREE
        for row, col in rng.integers(12, 45, (4, 2)):
            pixels[row : row + 3, col : col + 3] = WALL
    return pixels


def _noise(rng: np.random.Generator, rows: int, cols: int) -> Pixels:
    share = float(rng.choice([0.001, 0.01, 0.05, 0.3]))
    value = int(rng.choice([WALL, UNKNOWN]))
    return np.where(rng.random((rows, cols)) < share, value, FREE).astype(np.int8)


def _checkers(rng: np.random.Generator, rows: int, cols: int) -> Pixels:
    size = int(rng.choice([1, 6, 24]))
    fields = np.add.outer(np.arange(rows) // size, np.arange(cols) // size) % 2
    return (fields * WALL).astype(np.int8)


def _maze(rng: np.random.Generator, rows: int, cols: int) -> Pixels:
    """Return corridors that wind from one side to the other."""
    wide = int(rng.choice([8, 14]))
    pixels = np.zeros((rows, cols), np.int8)
    for number, row in enumerate(range(wide, rows, wide)):
        pixels[row] = WALL
        pixels[row, -wide:] = FREE if number % 2 else WALL
        pixels[row, :wide] = WALL if number % 2 else FREE
    return pixels


def _chambers(rng: np.random.Generator, rows: int, cols: int) -> Pixels:
    """Return chambers without doors."""
    size = int(rng.choice([12, 20]))
    pixels = np.zeros((rows, cols), np.int8)
    pixels[::size] = WALL
    pixels[:, ::size] = WALL
    return pixels


def _percents(rng: np.random.Generator, rows: int, cols: int) -> Pixels:
    return rng.integers(-1, 101, (rows, cols)).astype(np.int8)


def _frontier(rng: np.random.Generator, rows: int, cols: int) -> Pixels:
    """Return a free part, and the unknown around it."""
    pixels = np.full((rows, cols), UNKNOWN, np.int8)
    pixels[: rows - rows // 3, : cols - cols // 3] = FREE
    return pixels


CONTENTS: dict[str, Callable[[np.random.Generator, int, int], Pixels]] = {
    "free": lambda rng, rows, cols: np.zeros((rows, cols), np.int8),
    "unknown": lambda rng, rows, cols: np.full((rows, cols), UNKNOWN, np.int8),
    "walls": lambda rng, rows, cols: np.full((rows, cols), WALL, np.int8),
    "rooms": _rooms,
    "noise": _noise,
    "checkers": _checkers,
    "maze": _maze,
    "chambers": _chambers,
    "percents": _percents,
    "frontier": _frontier,
}
