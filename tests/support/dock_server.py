"""Imitation of Nav2's docking server, which docks and undocks a robot.

It follows opennav_docking's ``docking_server.cpp``; rosbags encodes the payloads, without code of
this project. Like the original it refuses an unknown dock (901) or type (902), and a robot too far
from its staging pose (905). A goal to dock a docked robot, or to undock a robot that is not
docked, ends as aborted, with success and no code.
"""

from __future__ import annotations

import math
from typing import Any

from tests.support.nav2_server import (
    ABORTED,
    CANCELED,
    SUCCEEDED,
    ActionServer,
    Faults,
    Handle,
    action_store,
)

GOALS = {
    "Dock": "bool use_dock_id\nstring dock_id\ngeometry_msgs/PoseStamped dock_pose\n"
    "string dock_type\nfloat32 max_staging_time\nbool navigate_to_staging_pose\n",
    "Undock": "string dock_type\nfloat32 max_undocking_time\n",
}
RESULTS = {
    "Dock": "bool success\nuint16 error_code\nuint16 num_retries\n",
    "Undock": "bool success\nuint16 error_code\n",
}
# Humble's package and the first release of Jazzy lack this member.
MESSAGE = "string error_msg\n"
# Type hashes of send_goal and get_result, computed in tests/wire/test_docking.py.
HASHES = {
    "Dock": (
        "RIHS01_9e60155a1fb741109942c5c7dc21ae0e0db771eaf55d0cfc768bae57a95f3454",
        "RIHS01_3e83e8a6eefb3ebe244cd0384418f43d22ffb1f3263fd7b978af8164591c50b3",
    ),
    "Undock": (
        "RIHS01_9c412dec37b7dad67b754dd860cdb03787c0924f01d4cd2b5c16506726b17dc3",
        "RIHS01_116641408dd0a5bbb7f0cb61d4519061884c7fcc70ca78b0f89779459cf04263",
    ),
}
CANCEL_HASH = "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a"
SPEED_M_S = 0.3
# Largest distance from the dock at which the approach starts [m].
STAGED_M = 1.0


def dock_store(move: str, *, with_message: bool = True) -> Any:
    """Return rosbags' types, including those of one of the actions."""
    return action_store(GOALS[move], RESULTS[move] + (MESSAGE if with_message else ""))


class DockActionServer(ActionServer):
    """The services of ``dock_robot`` or ``undock_robot``."""

    node = "docking_server"

    def __init__(self, move: str, wanted: dict[str, Any], faults: Faults) -> None:
        self.move = move
        self.with_message = wanted.get("with_message", True)
        # Humble uses another package.
        self.package = wanted.get("dock_package", "nav2_msgs")
        action = f"/{move.lower()}_robot"
        super().__init__(wanted["endpoint"], wanted["domain"], "jazzy", faults, action)

    def store_of(self, release: str) -> Any:
        return dock_store(self.move, with_message=self.with_message)

    def services(self, release: str) -> tuple[Any, Any]:
        kind = f"{self.package}::action::dds_::{self.move}Robot"
        types = (
            ("send_goal", f"{kind}_SendGoal_"),
            ("cancel_goal", "action_msgs::srv::dds_::CancelGoal_"),
            ("get_result", f"{kind}_GetResult_"),
        )
        sent, ended = HASHES[self.move]
        return types, (sent, CANCEL_HASH, ended)

    def _ended(self, handle: Handle | None) -> bytes:
        members: dict[str, Any] = {
            "status": handle.status if handle else 0,
            # The default of the message; only failures set it to False.
            "success": not handle.code if handle else True,
            "error_code": handle.code if handle else 0,
        }
        if self.move == "Dock":
            members["num_retries"] = 0
        if self.with_message:
            members["error_msg"] = handle.text if handle else ""
        return self._write("Ended", **members)


class DockingServer:
    """Docks and undocks.

    ``wanted["dock"]``: pose x, y, yaw of the robot in the dock; distance of the staging pose from
    it [m]; type of the only plugin; number of first attempts that fail with 904.
    """

    def __init__(self, robot: Any, wanted: dict[str, Any], faults: Faults) -> None:
        self.robot = robot
        self.x, self.y, self.yaw = wanted["dock"]["pose"]
        self.staging_m = wanted["dock"].get("staging_m", 0.5)
        self.type = wanted["dock"].get("type", "charging_dock")
        self.failures = wanted["dock"].get("failures", 0)
        self.log: list[str] = []
        self._servers = [DockActionServer(move, wanted, faults) for move in ("Dock", "Undock")]

    def close(self) -> list[str]:
        """Close the servers; return what they refused."""
        for server in self._servers:
            server.close()
        return [why for server in self._servers for why in server.refused]

    def tick(self, dt: float) -> None:
        """Move the robot according to the goals."""
        for server in self._servers:
            for handle in (server.pending, server.current):
                if handle is not None and handle.is_canceling:
                    self.log.append(f"{server.move} canceled")
                    server.end(handle, CANCELED)
            if server.pending is not None:
                handle = server.accept_pending()
                self.log.append(server.move)
                self._check(server, handle)
            elif server.current is not None:
                self._move(server, server.current, dt)

    def _is_docked(self) -> bool:
        return math.dist((self.robot.x, self.robot.y), (self.x, self.y)) < 0.05

    def _check(self, server: DockActionServer, handle: Handle) -> None:
        goal = handle.message
        if goal.dock_type not in ("", self.type):
            self._fail(server, handle, 902, f"no plugin {goal.dock_type}")
        elif server.move == "Undock":
            if not self._is_docked():
                server.end(handle, ABORTED)
        elif goal.use_dock_id and goal.dock_id != "home":
            self._fail(server, handle, 901, f"no dock {goal.dock_id}")
        elif self._is_docked():
            server.end(handle, ABORTED)
        elif not goal.use_dock_id and goal.dock_pose.header.frame_id != "map":
            self._fail(server, handle, 999, "no transform")
        elif self.failures:
            self.failures -= 1
            self._fail(server, handle, 904, "Failed initial dock detection")
        elif math.dist((self.robot.x, self.robot.y), (self.x, self.y)) > STAGED_M:
            self._fail(server, handle, 905, "Timed out approaching dock")

    def _fail(self, server: DockActionServer, handle: Handle, code: int, text: str) -> None:
        self.log.append(f"{server.move} {code}")
        server.end(handle, ABORTED, code, text)

    def _move(self, server: DockActionServer, handle: Handle, dt: float) -> None:
        """Drive a step into the dock, or backward out of it."""
        robot, goal = self.robot, handle.message
        x, y = self.x, self.y
        if server.move == "Undock":
            x -= self.staging_m * math.cos(self.yaw)
            y -= self.staging_m * math.sin(self.yaw)
        elif not goal.use_dock_id:
            x, y = goal.dock_pose.pose.position.x, goal.dock_pose.pose.position.y
        far = math.dist((robot.x, robot.y), (x, y))
        if far < 0.02:
            robot.yaw = self.yaw
            self.log.append(f"{server.move} succeeded")
            server.end(handle, SUCCEEDED)
            return
        step = min(SPEED_M_S * dt, far) / far
        robot.x += step * (x - robot.x)
        robot.y += step * (y - robot.y)
