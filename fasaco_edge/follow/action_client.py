"""A client of a ROS 2 action on the bus: its services' keys, requests to them, and their replies.

rmw_zenoh shows the server's types and keys in its graph; a bridge does not, and is queried by name.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from fasaco_edge.bus.queries import Reply
from fasaco_edge.bus.session import Bus
from fasaco_edge.wire.ros_keys import (
    Call,
    RosNode,
    attachment,
    bridge_keys,
    gid_of,
    served_keys,
    server_tokens,
)

# Timeout of a reply [s], and of a result, which comes only when the goal has been driven to its
# end. After the timeout the query is repeated.
ANSWER_S, RESULT_S = 2.5, 300.0
# Period of searching the graph for the action's server [s].
LOOK_EVERY_S = 2.0


class ActionClient:
    """Sends requests to the server of an action.

    Args:
        bus: the session.
        ros: how ROS is connected to Zenoh, as in ``FollowSettings``.
        action: its name.
        types: its types.
    """

    def __init__(
        self, bus: Bus, ros: Mapping[str, Any], action: str, types: tuple[str, ...]
    ) -> None:
        self._bus = bus
        self._domain: int = ros["domain"]
        self._action, self._types = action, types
        self._sequence = 0
        self._gid = b""
        self._roll = None
        # Replies, from Zenoh's threads.
        self._replies = deque[Callable[[], None]]()
        if ros["kind"] == "rmw_zenoh":
            node = RosNode(self._domain, bus.id, ros["namespace"], ros["node"])
            self._gid = gid_of(f"{node.token}/{action}")
            self._roll = bus.roll(server_tokens(self._domain, action))

    @property
    def is_seen(self) -> bool:
        """Whether the graph shows servers, and their types."""
        return self._roll is not None

    def look(self) -> None:
        """Search the graph for the server, at intervals."""
        if self._roll is not None:
            self._roll.ask(LOOK_EVERY_S)

    def keys(self) -> dict[Call, str]:
        """Return the keys of the server's services; none if the graph shows no server."""
        if self._roll is None:
            return bridge_keys(self._action)
        return served_keys(self._domain, self._action, self._roll.there(), self._types)

    @property
    def waiting(self) -> int:
        """Number of replies that have come, or will not come, and were not taken."""
        return len(self._replies)

    def take_replies(self) -> None:
        """Pass the replies that have come to those who asked."""
        while self._replies:
            self._replies.popleft()()

    def ask(self, call: Call, payload: bytes, take: Callable[[bytes | None], None]) -> None:
        """Send a request; ``take`` gets the reply in ``take_replies``, None for none."""

        def end(replies: list[Reply]) -> None:
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
