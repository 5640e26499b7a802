"""The product in the lab: the daemon's mission and the follower, stepped in simulated time.

Between the two go a path's bytes, as on the bus; maps and poses come as bytes, too.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.cli.follow import limits_of
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.writer import LedgerKeeper, NoDisk
from fasaco_edge.daemon.loop.inbox import blocked_of, make_mailbox
from fasaco_edge.daemon.loop.loader import mission_config
from fasaco_edge.daemon.loop.loop import TICK_S as LOOP_S
from fasaco_edge.daemon.loop.mission_runner import MissionRunner
from fasaco_edge.daemon.loop.outbox import headings
from fasaco_edge.daemon.loop.periodic import MOST_SQUARES
from fasaco_edge.daemon.loop.status import HEARTBEAT_S, StatusBoard
from fasaco_edge.follow.estimate import VelocityCommand
from fasaco_edge.follow.follower import Follower
from fasaco_edge.follow.sight import Mount, Sight
from fasaco_edge.follow.standstill import Standstill
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.core.path_exit import PublishedPath
from fasaco_edge.mission.events import Event, MapReceived, PoseReceived
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.messages.base import LaserScan, encode_scan
from fasaco_edge.wire.messages.maps import decode_occupancy_grid, encode_occupancy_grid
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from fasaco_edge.wire.schemas import POSE_STAMPED
from tests.campaigns.lab.planning import LockStepPlanning
from tests.campaigns.lab.settings import LEAST_RANGE_M, MOST_RANGE_M, stamp_ns

NAME = "lab"


class Product:
    """A daemon and a follower without bus, disk and threads.

    Attributes:
        paths: all paths published since they were last taken.
        faults: what the mission refused, and how often.
    """

    def __init__(self, config: DaemonConfig) -> None:
        self.paths: list[PublishedPath] = []
        self.faults: dict[str, int] = {}
        self._config = config
        self._planning = LockStepPlanning(config.planner)
        self._mission = Mission(
            mission_config(config, self._planning.planner), OrderState.autostart()
        )
        mailbox = make_mailbox(config.map.max_pixels)
        keeper = LedgerKeeper(NoDisk(), config.cell_m, autostart=True)
        self._runner = MissionRunner(config, keeper, mailbox)
        self._runner.mission = self._mission
        self._decoder = config.poses()
        self._events: list[Event] = []
        # The newest path and its revision, on its way to the follower.
        self._sent: tuple[bytes, int] | None = None
        self._sight = _sight(config)
        self.follower = _follower(config, self._sight)
        self._standstill, self._revision = Standstill(), 0
        self._heartbeat_at = self._stepped_at = -math.inf

    @property
    def state(self) -> str:
        """State of the mission."""
        return str(self._mission.state)

    @property
    def reason(self) -> str:
        """The mission's reason for it."""
        return self._mission.reason

    @property
    def plans(self) -> int:
        """How many plans were made."""
        return self._planning.plans

    def hear_map(self, grid: OccupancyGrid) -> None:
        """Take in a map; in a cycle maps come before poses, as in the daemon's inbox."""
        payload = encode_occupancy_grid(grid)
        decoded = decode_occupancy_grid(payload, self._config.map.max_pixels)
        self._events.insert(0, MapReceived(decoded))
        if self._sight is not None:
            self._sight.take_map(payload)

    def hear_pose(self, stamped: StampedPose, now: float, left_m: float = 0.0) -> None:
        """Take in a pose: mission and follower both do, at ``now`` [s].

        The follower takes the robot to be ``left_m`` further to the right than it is.
        """
        pose = self._decoder.decode(encode_pose_stamped(stamped), POSE_STAMPED)
        assert pose is not None
        self._events.append(PoseReceived(pose))
        x, y, yaw = pose.pose.x, pose.pose.y, pose.pose.yaw
        beside = Pose2D(x + left_m * math.sin(yaw), y - left_m * math.cos(yaw), yaw)
        self.follower.take_pose(replace(pose, pose=beside) if left_m else pose, now)

    def hear_scan(self, ranges: NDArray[np.float64], now: float) -> None:
        """Take in a scan, float64 (beams,) [m], 0 for no return: the follower does."""
        told = tuple(np.where(ranges > 0.0, ranges, np.inf).tolist())
        step = math.tau / (len(told) - 1)
        scan = LaserScan(-math.pi, step, LEAST_RANGE_M, MOST_RANGE_M, told, "laser", stamp_ns(now))
        self.follower.take_scan(encode_scan(scan), now)

    def step(self, now: float) -> VelocityCommand | None:
        """Run a cycle of both at ``now`` [s]; return the command to the base, None for none.

        The follower has a path one cycle after the mission has published it.
        """
        if self._sent is not None:
            (payload, self._revision), self._sent = self._sent, None
            self.follower.take_path(payload)
        if now - self._heartbeat_at >= HEARTBEAT_S:
            self._heartbeat_at = now
            self.follower.take_heartbeat(now)
        self._step_mission(now)
        command = self.follower.step(now)
        if (said := self._standstill.report(self.follower, NAME, self._revision, now)) is not None:
            self._events.append(blocked_of(said))
        return command

    def _step_mission(self, now: float) -> None:
        """Step the mission, and perform what it decides, as the daemon's loop does."""
        events, self._events = self._events, []
        plans = self._planning.take(now)
        if not events and not plans and now - self._stepped_at < LOOP_S:
            return
        self._stepped_at = now
        mission, runner = self._mission, self._runner
        decision = runner.step(mission, [*events, *plans], now)
        for fault in decision.faults:
            self.faults[fault.code] = self.faults.get(fault.code, 0) + 1
        if mission.route.requests.wanted and mission.route.requests.is_improving:
            self._planning.interrupt(now)
        if decision.plan is not None:
            self._planning.submit(decision.plan, now)
        if decision.path is not None and decision.plan is None and decision.path.plan is None:
            self._planning.interrupt(now)
        runner.paths.send(self._publish)

    def _publish(self, path: PublishedPath) -> bool:
        yaw = headings(path.xy) if path.yaw is None else path.yaw.copy()
        if len(yaw) and path.end_yaw is not None:
            yaw[-1] = path.end_yaw
        payload = encode_path(path.xy, yaw, path.frame, path.map_stamp_ns)
        self._sent = payload, path.revision
        self.paths.append(path)
        return True

    def report(self) -> ProductReport:
        """Return what the product says of its mission."""
        reply = StatusBoard(self._config).reply(self._runner, self._stepped_at)
        shown, grid = None, self._mission.grid
        if grid is not None:
            shown = self._mission.covered.floor.snapshot().as_grid(
                MOST_SQUARES, grid.frame, grid.stamp_ns
            )
        if shown is not None:
            turned = self._mission.rotation.geometry(shown.geometry)
            shown = OccupancyGrid(turned, shown.cells, shown.frame, shown.stamp_ns)
        return ProductReport(
            json.loads(encode_json(reply)), shown, grid, self.plans, dict(self.faults)
        )


@dataclass(frozen=True, slots=True, eq=False)
class ProductReport:
    """What the product says of its mission.

    Attributes:
        reply: state, reason, coverage, floor and order, as of a reply to a command.
        floor: the swept floor as it is published; None before there is one.
        grid: the map that it had last; None for none.
        plans: how many were made.
        faults: what the mission refused, and how often.
    """

    reply: dict[str, Any]
    floor: OccupancyGrid | None
    grid: OccupancyGrid | None
    plans: int
    faults: dict[str, int]


def _sight(config: DaemonConfig) -> Sight | None:
    """Return what the follower sees by; None without scans."""
    if not config.scan:
        return None
    scan = config.scan
    return Sight(Mount(), config.robot.radius_m, scan.lost_s, config.map.free_at_most)


def _follower(config: DaemonConfig, sight: Sight | None) -> Follower:
    """Return a follower as ``fasaco-edge follow`` makes it."""
    follower = Follower(limits_of(config.robot), sight=sight, radius=config.robot.radius_m)
    follower.take_planner(NAME)
    return follower
