"""Senseless events into a mission within this process: as a daemon's loop would, without a bus.

Payloads are decoded, the mission steps, a real planner plans for a counted number of questions, all
that would be published is encoded, and what would be kept is written and read again. After each
turn hold what has to: the lattice that was kept up to date is the one that is made afresh, a walk
is legal on it, counts add up; a mission at rest has published an empty path last, and a path that
is not empty is that of the mission in force. The same events make the same turns.
"""

from __future__ import annotations

import json
import random
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.fleet_wing import company_of
from fasaco_edge.daemon.ledger.codec import decode_ledger, encode_ledger
from fasaco_edge.daemon.ledger.rooms_file import decode_rooms, encode_rooms
from fasaco_edge.daemon.loop.loader import mission_config
from fasaco_edge.daemon.loop.mission_reports import mission_report, unswept
from fasaco_edge.daemon.loop.outbox import headings
from fasaco_edge.daemon.loop.periodic import MOST_SQUARES, ShownTrail
from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.fine_raster import map_to_raster
from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.occupancy import OccupancyGrid, coarser
from fasaco_edge.grid.rotation import rotated_points
from fasaco_edge.mission.core import look_around
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.core.path_exit import PathExit, PublishedPath
from fasaco_edge.mission.events import (
    CommandReceived,
    Decision,
    MapReceived,
    PatchesLost,
    PatchReceived,
    PlanReady,
    PlanRequest,
    PoseReceived,
)
from fasaco_edge.mission.map.ground import MissionGround
from fasaco_edge.mission.orders.commands import read_command
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.planners.planner import ColonySnapshot, SearchProgress, StopRecorder
from fasaco_edge.planners.registry import planner_of
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.messages.maps import (
    coverage_values,
    decode_map_update,
    decode_occupancy_grid,
    encode_occupancy_grid,
)
from fasaco_edge.wire.messages.paths import decode_path, encode_path
from fasaco_edge.wire.messages.pheromone import encode_pheromone
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.schemas import TF_MESSAGE
from tests.campaigns import raw_messages
from tests.campaigns.line_judge import why_touching
from tests.campaigns.senseless import Event, pixels_of
from tests.mission.test_line import check_tally

MOST_CELLS = 20_000
# Cycles between two checks of the encoded ledger.
KEPT_EVERY = 40
# Cycles between two checks of the lattice.
FRESH_EVERY = 5
HONEST_TURNS = 6


class BrokenInvariantError(AssertionError):
    """What has to hold in every state does not."""


class MissionTrial:
    """A mission that gets events.

    Attributes:
        counts: of what happened, by name; codes of faults among them.
        slowest_s: the longest turns, each with what it took in.
    """

    def __init__(self, seed: int) -> None:
        self.counts = Counter[str]()
        self.slowest_s: list[tuple[float, str]] = []
        self._rng = random.Random(seed)
        self._now = 0.0
        self._commands = 0
        self._turns = 0
        self._batch: list[Any] = []
        self._size = 1
        self._paths = PathExit()
        # The path that followers have: they begin with one of a daemon that was killed.
        self._driven = PublishedPath("map", "left behind", 1, np.ones((2, 2)))
        self._begin({}, None)
        self._paths.void("begun", "map")
        self._send_path()

    def perform(self, event: Event) -> None:
        """Take an event, and turn when there are enough of them.

        Raises:
            Exception: what no message may lead to.
        """
        match event["do"]:
            case "wait":
                self._now += event["s"]
                self._turn()
            case "checkpoint":
                self._check_recovery(event["map"])
            case "restart":
                self._turn()
                self._begin(event["sections"], None if event["fresh"] else self._mission)
            case "reload":
                self._turn()
                self._begin(event["sections"], self._mission, keeps_site=True)
            case "drive":
                self._drive(event)
            case name:
                self._take(name, event)
        if len(self._batch) >= self._size:
            self._turn()

    def close(self) -> None:
        """Turn once more."""
        self._turn()

    def _begin(self, sections: Event, before: Mission | None, *, keeps_site: bool = False) -> None:
        if not keeps_site:
            self._robot = sections.get("robot", {})
        known = {key: value for key, value in sections.items() if key != "ros2"}
        known["robot"] = self._robot | known.get("robot", {}) if keeps_site else self._robot
        known["map"] = {**known.get("map", {}), "max_lattice_cells": MOST_CELLS}
        config = msgspec.convert(known, DaemonConfig)
        planner = config.planner
        self._planner = planner_of(planner.name, planner.colony())
        self._config = mission_config(config, self._planner)
        mission = Mission(self._config, kind=company_of(config))
        self._poses = PoseDecoder(config.pose.schema)
        self._asked: PlanRequest | None = None
        self._paths.withdraw("another mission")
        self._send_path()
        _hold(self._driven.stops or before is None, "the path of a mission that has ended")
        if before is not None:
            kept = before.snapshot()
            snapshot = decode_ledger(encode_ledger(kept), kept.cell_m)
            if snapshot.cell_m == config.cell_m:
                mission.restore(snapshot, OrderState.from_json(snapshot.note), before.rooms)
            if keeps_site and before.grid is not None:
                self._batch.append(MapReceived(before.grid))
        self._mission = mission
        self.counts["missions"] += 1

    def _drive(self, event: Event) -> None:
        path, lattice = self._mission.route.path, self._mission.lattice
        if lattice is None or path is None or not len(path.ahead):
            return
        x, y = lattice.centres(path.ahead[: self._rng.choice([1, 2, 2, 3])])[-1].tolist()
        pose = {"type": "PoseStamped", "frame": self._mission.grid.frame, "stamp": 1, "yaw": 0.0}
        self._take("pose", pose | {"x": x + event["off"], "y": y})

    def _take(self, name: str, event: Event) -> None:
        """Decode a message; one that is refused is counted."""
        try:
            match name:
                case "map":
                    payload = raw_messages.occupancy_grid(event, pixels_of(event))
                    self._batch.append(MapReceived(decode_occupancy_grid(payload)))
                case "update":
                    self._batch.append(PatchReceived(decode_map_update(raw_messages.update(event))))
                case "pose":
                    schema = raw_messages.POSE_SCHEMAS[event["type"]]
                    pose = self._poses.decode(raw_messages.pose(event), schema)
                    self._batch.append(PoseReceived(pose))
                case "tf":
                    payload = raw_messages.transform(event)
                    told = self._poses.decode(payload, TF_MESSAGE, is_static=event["static"])
                    self._batch += [] if told is None else [PoseReceived(told)]
                case "command":
                    self._commands += 1
                    asked = read_command(event["document"])
                    if asked.name != "status":
                        self._batch.append(CommandReceived(self._commands, *asked))
                case "publisher":
                    self._batch.append(PatchesLost(2))
        except FasacoError as error:
            self.counts[f"refused: {error.code}"] += 1

    def _turn(self) -> None:
        """Let the mission step, as the daemon's loop does, and check what has to hold."""
        events, self._batch = self._batch, []
        self._size = self._rng.choice([0, 1, 1, 2, 5, 20])
        self._now += self._rng.choice([0.0, 0.02, 0.1, 0.1, 0.6])
        if self._asked is not None and self._rng.random() < 0.7:
            events.append(self._plan(self._asked))
            self._asked = None
        started = time.thread_time()
        decision = self._mission.step(events, self._now)
        took_s = time.thread_time() - started
        self._asked = decision.plan or self._asked
        self._note_slow(took_s, events)
        self._turns += 1
        for fault in decision.faults:
            self.counts[f"fault: {fault.code}"] += 1
        self._publish(decision)
        self._check_path(decision)
        self._check()

    def _check_path(self, decision: Decision) -> None:
        """Check that followers have the path of the mission in force, and none at rest."""
        mission = self._mission
        self._paths.follow(mission, decision.path)
        self._send_path()
        route, driven = mission.route, self._driven
        about = f"{mission.state} ({mission.reason}), path {driven.revision}: {driven.reason}"
        rests = mission.state not in ("planning", "covering", "returning", "degraded")
        _hold(driven.stops or not rests, f"a path at rest: {about}")
        has_path = len(route.path.cells) > 0 or route.is_way_out
        _hold(driven.stops != has_path, f"another path than driven: {about}")
        if not driven.stops:
            _hold(driven.revision == route.revision, f"{route.revision} is driven, {about}")
            self.counts["turns with a path in force"] += 1
        self.counts["turns at rest"] += rests

    def _send_path(self) -> None:
        self._driven = self._paths.send(lambda path: True) or self._driven

    def _plan(self, request: PlanRequest) -> PlanReady:
        """Plan for a counted number of questions, so that the same events lead to the same path."""
        asked, patience = 0, self._rng.choice([1, 1, 8])

        def stop(progress: SearchProgress) -> bool:
            nonlocal asked
            asked += 1
            return asked >= patience

        seen: list[ColonySnapshot] = []
        noted = StopRecorder(stop)
        path = self._planner.plan(request.problem, noted, seen.append)
        if seen:
            self._say("pheromone", lambda: encode_pheromone(seen[0], "map", 1))
        self.counts["plans"] += 1
        return PlanReady(request.number, path, 0.01, tuple(noted.stops))

    def _publish(self, decision: Decision) -> None:
        """Encode all that the daemon would say; a limit may refuse it, nothing else may happen."""
        mission = self._mission
        lattice, grid = mission.lattice, mission.grid
        update = decision.path
        if update is not None:
            assert lattice is not None
            self._check_walk(update.cells)
            if update.xy is not None:
                self._check_line(update.xy, update.reason)
            xy = lattice.centres(update.cells) if update.xy is None else update.xy
            payload = self._say(
                "path", lambda: encode_path(xy, headings(xy), grid.frame, grid.stamp_ns)
            )
            if payload is not None:
                decode_path(payload)
            self.counts["paths"] += 1
        if lattice is not None and self._turns % FRESH_EVERY == 0:
            geometry = GridGeometry.of_cells(lattice.window, lattice.cell_m)
            values = coverage_values(lattice.states, mission.covered.current.visits(lattice.window))
            covered = OccupancyGrid(geometry, values, grid.frame, grid.stamp_ns)
            self._say("coverage", lambda: encode_occupancy_grid(covered))
            self._say("floor", lambda: self._floor(grid))
            self._say("unswept", self._unswept)
            self._say("trail", self._trail)
        report = encode_json({"report": mission_report(mission, mission.order_state)})
        json.loads(report)

    def _floor(self, grid: OccupancyGrid) -> bytes:
        """Return the swept floor as it is published, b"" where it is too wide to be shown."""
        shown = self._mission.covered.floor.snapshot().as_grid(
            MOST_SQUARES, grid.frame, grid.stamp_ns
        )
        return b"" if shown is None else encode_occupancy_grid(shown)

    def _unswept(self) -> bytes:
        """Return why floor is not swept, as it is published, b"" where that is not known."""
        shown = unswept(self._mission)
        return b"" if shown is None else encode_occupancy_grid(coarser(shown, MOST_SQUARES))

    def _trail(self) -> bytes:
        """Return the living trail, and where it points to, as they are published."""
        held = self._mission.trail.snapshot()
        if not held.window.rows * held.window.cols:
            return b""
        shown = ShownTrail(held, 1, self._config.footprint.cell_m, "map", 1, 1, 1)
        return b"".join(shown.field()) + shown.directions()

    def _say(self, what: str, encode: Callable[[], bytes]) -> bytes | None:
        try:
            return encode()
        except FasacoError as error:
            self.counts[f"unsaid {what}: {error.code}"] += 1
        return None

    def _check(self) -> None:
        mission = self._mission
        coverage = mission.coverage()
        if coverage is not None:
            counts = (0, coverage.recovered, coverage.covered, coverage.coverable)
            _hold(list(counts) == sorted(counts), f"coverage {coverage}")
        if self._turns % KEPT_EVERY == 0:
            self._check_kept()
        if self._turns % FRESH_EVERY == 0:
            self._check_lattice()

    def _check_kept(self) -> None:
        """Check that what is kept is read as it was."""
        snapshot = self._mission.snapshot()
        again = decode_ledger(encode_ledger(snapshot), snapshot.cell_m)
        _hold(again.total == snapshot.total and again.frame == snapshot.frame, "ledger's head")
        _hold(again.under_tool == frozenset(snapshot.under_tool), "cells under the tool")
        _hold(set(again.tiles) == set(snapshot.tiles), "tiles")
        for place, tile in snapshot.tiles.items():
            _hold(bool((again.tiles[place] == tile).all()), f"tile {place}")
        floor, floor_again = snapshot.floor.tiles, again.floor.tiles
        _hold(set(floor_again) == set(floor), "tiles of floor")
        for place, swept in floor.items():
            _hold(bool((floor_again[place] == swept).all()), f"tile of floor {place}")
        _hold(snapshot.floor.pixels == self._mission.covered.floor.pixels, "swept pixels")
        _hold(OrderState.from_json(again.note).to_json() == snapshot.note, "note")
        rooms = encode_rooms(self._mission.rooms)
        _hold(encode_rooms(decode_rooms(rooms)) == rooms, "rooms")
        self.counts["rooms read again"] += len(self._mission.rooms.rooms)
        self.counts["ledgers read again"] += 1
        self.counts["largest ledger [tiles]"] = max(
            self.counts["largest ledger [tiles]"], len(snapshot.tiles)
        )

    def _check_lattice(self) -> None:
        """Check that the lattice is, bit for bit, the one that the newest map has."""
        mission, order = self._mission, self._mission.order_state.order
        keeps_out = (order and order.keep_out) or self._config.policy.keep_out
        keeps_out = keeps_out or mission.order_state.keep_out
        grid = mission.map.grid
        if grid is None or mission.lattice is None or keeps_out:
            return
        fresh = MissionGround(mission.rotation.config(self._config))
        fresh.begin_lattice(grid)
        geometry = grid.geometry
        for name in ("window", "states", "steps"):
            now, anew = getattr(mission.lattice, name), getattr(fresh.lattice, name)
            _hold(np.array_equal(now, anew), f"{name} over {geometry}")
        if fresh.floor is not None:
            for name in ("blocked", "places"):
                now, anew = getattr(mission.map.ground.floor, name), getattr(fresh.floor, name)
                _hold(np.array_equal(now, anew), f"{name} over {geometry}")
            check_tally(mission)
        self.counts["lattices made afresh"] += 1

    def _check_walk(self, cells: np.ndarray[Any, Any]) -> None:
        """Check that a walk is over coverable cells, by steps that the lattice allows."""
        lattice = self._mission.lattice
        assert lattice is not None
        for cell in cells.tolist():
            _hold(lattice.contains(tuple(cell)), f"path leaves the lattice at {cell}")
        local = cells - np.array([lattice.window.row0, lattice.window.col0])
        _hold(bool(lattice.coverable[local[:, 0], local[:, 1]].all()), "path on other ground")
        apart = np.abs(np.diff(cells, axis=0)).sum(axis=1)
        _hold(bool((apart == 1).all()), "path not connected")

    def _check_line(self, xy: np.ndarray[Any, Any], reason: str) -> None:
        """Check that a line leads over places where the robot may be."""
        floor, grid = self._mission.map.ground.floor, self._mission.map.grid
        assert grid is not None
        _hold(bool(np.isfinite(xy).all()), "a line that leads nowhere")
        laid = rotated_points(xy, -self._mission.rotation.deg)
        if reason == look_around.WHY:
            # On the spot, also where the map does not show that the robot may be there.
            pose = self._mission.map.pose
            assert pose is not None
            away_m = np.hypot(*(laid - (pose.pose.x, pose.pose.y)).T).max()
            _hold(away_m <= look_around.SIDE_M + 1e-6, f"a turn leads {away_m:.2f} m away")
            return
        assert floor is not None
        unit_m = floor.geometry.resolution
        points = [map_to_raster(floor.geometry, x, y) for x, y in laid.tolist()]
        map_px = grid.geometry.resolution / unit_m
        wall = why_touching(floor.blocked, points, floor.discs.radius_m / unit_m, reason, map_px)
        _hold(not wall, wall)
        self.counts["lines"] += 1

    def _check_recovery(self, event: Event) -> None:
        """Give an honest map and honest poses, as a robot would that begins anew."""
        self._turn()
        # Whatever was ordered, however it stands: now everything is.
        for command in ("reset", "start"):
            self._take("command", {"document": {"command": command, "discard": True}})
        self._take("map", event)
        for turn in range(HONEST_TURNS):
            pose = {"type": "PoseStamped", "frame": event["frame"], "stamp": 1, "yaw": 0.0}
            self._take("pose", pose | {"x": 1.0 + 0.01 * turn, "y": 1.0})
            self._turn()
            self._now += 0.2
        grid = self._mission.grid
        known = grid is not None and grid.stamp_ns == event["stamp"]
        _hold(known, f"an honest map was not taken: {self._mission.reason}")
        state = str(self._mission.state)
        settled = state in ("planning", "covering", "done", "blocked", "degraded")
        _hold(settled, f"{state} after an honest map and pose: {self._mission.reason}")
        self.counts["honest again"] += 1

    def _note_slow(self, took_s: float, events: list[Any]) -> None:
        names = ", ".join(sorted({type(event).__name__ for event in events})) or "nothing"
        geometry = self._mission.grid and self._mission.grid.geometry
        self.slowest_s.append((took_s, f"{names}; map {geometry}"))
        self.slowest_s = sorted(self.slowest_s, reverse=True)[:5]


def _hold(holds: bool, what: str) -> None:
    if not holds:
        raise BrokenInvariantError(what)
