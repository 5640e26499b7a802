"""Nav2's controller on the bus: sends the follower's goals, returns replies once a cycle."""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypeVar

from fasaco_edge.bus.queries import QueryReply
from fasaco_edge.bus.session import Bus
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.follow.nav2 import AskResult, Nav2Follower, Request, SendPiece
from fasaco_edge.follow.node import Node, patience_of
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.wire.messages.nav2_goals import (
    ENDED_BEFORE,
    GOAL_ID_BYTES,
    NO_SUCH_GOAL,
    TAKEN,
    decode_accepted,
    decode_cancel,
    decode_ending,
    encode_cancel,
    encode_goal,
    encode_goal_id,
)
from fasaco_edge.wire.ros_keys import (
    RELEASES,
    Call,
    Release,
    RosNode,
    attachment,
    bridge_keys,
    gid_of,
    release_of,
    served_keys,
    server_tokens,
)

_Value = TypeVar("_Value")

# Retry period of a cancellation [s].
CANCEL_EVERY_S = 1.0
# Largest number of goals being cancelled; the oldest are dropped, as the server has ended them.
MOST_CANCELLED = 8
# Timeouts of a reply, and of a result, which arrives only when the goal has ended [s].
ANSWER_S, RESULT_S = 2.5, 300.0
# Longest wait at the exit for the server to confirm cancellations [s].
END_S = 1.0
# Period of searching the graph for the action's server [s].
LOOK_EVERY_S = 2.0


class Cancellations:
    """The goals to cancel: each is requested every second until the server confirms it."""

    def __init__(self) -> None:
        # Time of the last request for each goal [s]; goals neither accepted nor refused yet, which
        # the server may not know.
        self._asked_at: dict[bytes, float] = {}
        self._unanswered: set[bytes] = set()

    def add(self, goal_id: bytes) -> None:
        """Cancel a goal."""
        self._asked_at[goal_id] = -math.inf
        while len(self._asked_at) > MOST_CANCELLED:
            self.drop(next(iter(self._asked_at)))

    def drop(self, goal_id: bytes) -> None:
        """Take in that a goal has ended."""
        self._asked_at.pop(goal_id, None)

    @property
    def are_open(self) -> bool:
        """Whether any cancellation is still unconfirmed."""
        return bool(self._asked_at)

    def take_sent(self, goal_id: bytes) -> None:
        """Take in that a goal was sent."""
        self._unanswered.add(goal_id)

    def take_accepted(self, goal_id: bytes, accepted: bool | None) -> None:
        """Take in whether a goal was accepted; None without an answer."""
        self._unanswered.discard(goal_id)
        if accepted is False:
            self.drop(goal_id)
        elif goal_id in self._asked_at:
            self._asked_at[goal_id] = -math.inf

    def take_answer(self, goal_id: bytes, code: int | None) -> None:
        """Take in the answer to a cancellation; None without an answer."""
        if goal_id not in self._unanswered and code in (TAKEN, NO_SUCH_GOAL, ENDED_BEFORE):
            self.drop(goal_id)

    def due(self, now: float) -> list[bytes]:
        """Return the goals to cancel now."""
        due = [goal for goal, at in self._asked_at.items() if now - at >= CANCEL_EVERY_S]
        self._asked_at |= dict.fromkeys(due, now)
        return due


class ActionClient:
    """Sends requests to the server of an action, and passes on its replies.

    rmw_zenoh shows the server's types and keys in its graph; a bridge does not, and is queried by
    name.

    Args:
        bus: the session.
        ros: how ROS is connected to Zenoh, as in ``FollowSettings``.
        action: name of the action.
        follower: takes the replies, in ``turn``.
        clock: returns the time for the follower [s].
    """

    def __init__(
        self,
        bus: Bus,
        ros: Mapping[str, Any],
        action: str,
        follower: Nav2Follower,
        clock: Callable[[], float],
    ) -> None:
        self._bus, self._follower, self._clock = bus, follower, clock
        self._domain: int = ros["domain"]
        self._action = action
        self._cancellations = Cancellations()
        self._sequence = 0
        self._gid = b""
        self._token_list = None
        # Replies, from Zenoh's threads.
        self._replies = deque[Callable[[], None]]()
        if ros["kind"] == "rmw_zenoh":
            node = RosNode(self._domain, bus.id, ros["namespace"], ros["node"])
            self._gid = gid_of(f"{node.token}/{action}")
            self._token_list = bus.token_list(server_tokens(self._domain, action))

    @property
    def is_seen(self) -> bool:
        """Whether the graph shows servers, and their types."""
        return self._token_list is not None

    def keys(self) -> dict[Call, str]:
        """Return the keys of the server's services; empty if the graph shows no server."""
        if self._token_list is None:
            return bridge_keys(self._action)
        return served_keys(self._domain, self._action, self._token_list.there())

    def turn(self) -> None:
        """Look for the server and cancel goals, at intervals, and pass on the replies."""
        if self._token_list is not None:
            self._token_list.ask(LOOK_EVERY_S)
        while self._replies:
            self._replies.popleft()()
        self._cancel()

    def end(self) -> None:
        """Wait up to END_S until the server has confirmed all cancellations."""
        ends = time.monotonic() + END_S
        while self._cancellations.are_open and time.monotonic() < ends:
            self.turn()
            time.sleep(0.01)

    def ask(self, request: Request, goal: bytes = b"") -> None:
        """Send a request; ``goal``: the payload of a ``SendPiece``."""
        if isinstance(request, SendPiece):
            self._cancellations.take_sent(request.id)
            self._ask("send_goal", goal, partial(self._take_accepted, request.id))
        elif isinstance(request, AskResult):
            take = partial(self._take_result, request.id, time.monotonic())
            self._ask("get_result", encode_goal_id(request.id), take)
        else:
            self._cancellations.add(request.id)
            self._cancel()

    def _cancel(self) -> None:
        for goal_id in self._cancellations.due(time.monotonic()):
            self._ask("cancel_goal", encode_cancel(goal_id), partial(self._take_cancelled, goal_id))

    def _take_accepted(self, goal_id: bytes, reply: bytes | None) -> None:
        accepted, why = self._read(decode_accepted, reply)
        self._cancellations.take_accepted(goal_id, accepted)
        self._follower.take_accepted(goal_id, accepted, why, self._clock())

    def _take_result(self, goal_id: bytes, asked_at: float, reply: bytes | None) -> None:
        if reply is None:
            self._follower.take_silence(goal_id, time.monotonic() - asked_at, self._clock())
        else:
            ending, why = self._read(decode_ending, reply)
            if ending is not None:
                self._cancellations.drop(goal_id)
            self._follower.take_ending(goal_id, ending, why, self._clock())

    def _take_cancelled(self, goal_id: bytes, reply: bytes | None) -> None:
        self._cancellations.take_answer(goal_id, self._read(decode_cancel, reply)[0])

    def _read(
        self, decode: Callable[[bytes], _Value], reply: bytes | None
    ) -> tuple[_Value | None, str]:
        """Return a decoded reply and "", or None and why there is no valid reply."""
        if reply is None:
            return None, f"{self._action} did not answer"
        try:
            return decode(reply), ""
        except MalformedMessage as error:
            return None, str(error)

    def _ask(self, call: Call, payload: bytes, take: Callable[[bytes | None], None]) -> None:
        """Send a request; ``take`` gets the reply in ``turn``, or None without a reply."""

        def end(replies: list[QueryReply]) -> None:
            reply = next((reply.payload for reply in replies if not reply.is_error), None)
            self._replies.append(partial(take, reply))

        key = self.keys().get(call)
        if key is None:
            end([])
            return
        self._sequence += 1
        beside = attachment(self._sequence, time.time_ns(), self._gid) if self._gid else b""
        timeout_s = RESULT_S if call == "get_result" else ANSWER_S
        self._bus.ask(key, payload, beside, timeout_s, end)


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
        self._client = ActionClient(bus, ros, nav2["action"], follower, self._inputs.now)
        if ros["kind"] == "rmw_zenoh":
            bus.token(RosNode(ros["domain"], bus.id, ros["namespace"], ros["node"]).token)

    def end(self) -> None:
        """Stop the robot, and wait for Nav2's confirmation."""
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
