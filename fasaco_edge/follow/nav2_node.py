"""Nav2's controller on the bus: the follower's requests as queries, their replies by cycle."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import partial

from fasaco_edge.bus.session import Bus
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.follow.action_client import ActionClient
from fasaco_edge.follow.inputs import Inputs, patience_of
from fasaco_edge.follow.nav2 import Nav2Follower
from fasaco_edge.follow.nav2_requests import AskResult, CancelGoal, Request, SendGoal
from fasaco_edge.follow.node import Role, StateLog
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.wire.messages.follow_path import (
    GOAL_ID_BYTES,
    decode_accepted,
    decode_cancel,
    decode_ending,
    encode_cancel,
    encode_goal,
    encode_goal_id,
)
from fasaco_edge.wire.ros_keys import FOLLOW_PATH, RELEASES, Call, Release, RosNode, release_of

# A server that ends a query for a result sooner, without a reply, is gone [s].
GONE_S = 290.0
# Timeout for goals to end at the exit [s].
END_S = 1.0


def nav2_node(bus: Bus, settings: FollowSettings, report: Callable[[str], None]) -> Nav2Node:
    """Return the node that sends goals to Nav2's controller."""
    return Nav2Node(bus, settings, report)


class Nav2Node:
    """Takes the inputs, steps the follower, and sends its requests to Nav2."""

    def __init__(self, bus: Bus, settings: FollowSettings, report: Callable[[str], None]) -> None:
        nav2, ros = settings.nav2, settings.ros
        self._report = report
        self._is_dry = settings.dry_run
        self._action: str = nav2["action"]
        self._domain: int = ros["domain"]
        self._plugins: list[str] = list(nav2["plugins"])
        self._release: Release = nav2["release"]
        new_id = partial(os.urandom, GOAL_ID_BYTES)
        speed = settings.speed_m_s
        self._follower = Nav2Follower(
            nav2["near_m"],
            speed,
            new_id,
            patience_of(settings),
            settings.radius_m,
            is_curved=settings.turn_radius_m > 0.0,
        )
        self._inputs = Inputs(settings, bus)
        self._states = StateLog()
        self._client = ActionClient(bus, ros, self._action, FOLLOW_PATH)
        self._role = Role(bus, settings)
        if ros["kind"] == "rmw_zenoh":
            bus.token(RosNode(self._domain, bus.id, ros["namespace"], ros["node"]).token)

    def turn(self) -> None:
        """Take the inputs, and send the resulting requests."""
        self._client.look()
        self._client.take_replies()
        self._inputs.feed(self._follower)
        self._role.turn(self._inputs, self._follower)
        now = self._inputs.now()
        for request in self._follower.step(now):
            self._ask(request)
        self._role.report(self._inputs, self._follower, now)
        self._states.note(self._follower.state, self._follower.detail)

    def end(self) -> None:
        """Stop the robot."""
        self._role.end()
        requests = self._follower.end()
        for request in requests:
            self._ask(request)
        ends = time.monotonic() + END_S
        while requests and self._client.waiting < len(requests) and time.monotonic() < ends:
            time.sleep(0.01)

    def _ask(self, request: Request) -> None:
        follower, now = self._follower, self._inputs.now()
        if self._is_dry:
            if isinstance(request, SendGoal):
                (x, y), count = request.points[-1], len(request.points)
                self._report(f"a goal of {count} poses, to {x:.2f}, {y:.2f} in {request.frame!r}")
            return
        goal_id = request.id
        if isinstance(request, SendGoal):
            call: Call = "send_goal"
            release, why = self._release_at(self._client.keys())
            if release is None:
                follower.take_unsent(goal_id, why, now)
                return
            plugins = self._plugins[: RELEASES[release]]
            payload = encode_goal(
                goal_id,
                request.points,
                request.frame,
                0,
                plugins,
                request.end_yaw,
                is_back=request.is_back,
            )
        elif isinstance(request, AskResult):
            call, payload = "get_result", encode_goal_id(goal_id)
        else:
            call, payload = "cancel_goal", encode_cancel(goal_id)
        self._client.ask(call, payload, partial(self._take, request, time.monotonic()))

    def _take(self, request: Request, asked_at: float, payload: bytes | None) -> None:
        """Pass the result of a request to the follower."""
        follower, now = self._follower, self._inputs.now()
        why = f"{self._action} did not answer"
        try:
            if isinstance(request, SendGoal):
                accepted = None if payload is None else decode_accepted(payload)
                follower.take_accepted(request.id, accepted, why if accepted is None else "", now)
            elif isinstance(request, CancelGoal):
                code = None if payload is None else decode_cancel(payload)
                follower.take_cancelled(request.id, code)
            elif payload is not None:
                follower.take_ending(request.id, decode_ending(payload), "", now)
            elif time.monotonic() - asked_at < GONE_S:
                follower.take_ending(request.id, None, f"{self._action} went away", now)
            else:
                self._ask(request)
        except MalformedMessage as error:
            if isinstance(request, SendGoal):
                follower.take_accepted(request.id, None, str(error), now)
            elif isinstance(request, AskResult):
                follower.take_ending(request.id, None, str(error), now)

    def _release_at(self, keys: dict[Call, str]) -> tuple[Release | None, str]:
        """Return the ROS release of the server's goals; or why none can be sent."""
        if not self._client.is_seen:
            return self._release, ""
        if len(keys) < 3:
            return None, f"no server of {self._action} in domain {self._domain}"
        found = release_of(keys["send_goal"])
        type_hash = keys["send_goal"].rpartition("/")[2]
        return found, f"its FollowPath type is unknown: {type_hash}"
