"""Nav2's controller on the bus: sends the follower's requests, returns replies once a cycle."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial

from fasaco_edge.bus.session import Bus
from fasaco_edge.follow.actions import ActionClient, Request
from fasaco_edge.follow.nav2 import Nav2Follower, SendPiece
from fasaco_edge.follow.node import Node, patience_of
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.wire.messages.nav2_goals import GOAL_ID_BYTES, decode_ending, encode_goal
from fasaco_edge.wire.ros_keys import FOLLOW_PATH, RELEASES, Release, RosNode, release_of


class Nav2Node(Node):
    """Sends the follower's goals to Nav2."""

    _follower: Nav2Follower

    def __init__(self, bus: Bus, settings: FollowSettings, report: Callable[[str], None]) -> None:
        nav2, ros = settings.nav2, settings.ros
        follower = Nav2Follower(
            nav2["near_m"],
            settings.limits.speed,
            partial(os.urandom, GOAL_ID_BYTES),
            patience_of(settings),
            settings.radius_m,
            is_curved=settings.limits.turn_radius > 0.0,
        )
        super().__init__(bus, settings, follower)
        self._report = report
        self._client = ActionClient(
            bus, ros, nav2["action"], FOLLOW_PATH, follower, decode_ending, self._inputs.now
        )
        if ros["kind"] == "rmw_zenoh":
            bus.token(RosNode(ros["domain"], bus.id, ros["namespace"], ros["node"]).token)

    def end(self) -> None:
        """Stop the robot, and wait for Nav2's confirmation."""
        super().end()
        self._ask(self._follower.end())
        self._client.end()

    def _step(self, now: float) -> None:
        self._client.turn()
        self._ask(self._follower.step(now))

    def _ask(self, requests: list[Request]) -> None:
        for request in requests:
            if isinstance(request, SendPiece):
                self._send(request)
            elif not self._settings.dry_run:
                self._client.ask(request)

    def _send(self, piece: SendPiece) -> None:
        points, frame, yaw = piece.points, piece.frame, piece.end_yaw
        if self._settings.dry_run:
            x, y = points[-1]
            self._report(f"a goal of {len(points)} poses, to {x:.2f}, {y:.2f} in {frame!r}")
            return
        release, why = self._release()
        if release is None:
            self._follower.take_unsent(piece.id, why, self._inputs.now())
            return
        plugins = self._settings.nav2["plugins"][: RELEASES[release]]
        goal = encode_goal(piece.id, points, frame, 0, plugins, yaw, is_back=piece.is_back)
        self._client.ask(piece, goal)

    def _release(self) -> tuple[Release | None, str]:
        """Return the ROS release of the server, or None and why no goal can be sent."""
        settings, keys = self._settings, self._client.keys()
        if not self._client.is_seen:
            return settings.nav2["release"], ""
        if len(keys) < 3:
            domain = settings.ros["domain"]
            return None, f"no server of {settings.nav2['action']} in domain {domain}"
        type_hash = keys["send_goal"].rpartition("/")[2]
        return release_of(keys["send_goal"]), f"its FollowPath type is unknown: {type_hash}"
