"""Nav2's docking server on the bus: requests of ``Docking`` as queries, their replies by cycle."""

from __future__ import annotations

import logging
import os
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from fasaco_edge.bus.queries import Reply
from fasaco_edge.bus.session import Bus
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.follow.action_client import ActionClient
from fasaco_edge.follow.docking import Ask, Docking, DockRequest, Move, Start
from fasaco_edge.follow.inputs import Inputs
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.follow.supervision import Supervision
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.messages.docking import (
    decode_dock_ending,
    decode_undock_ending,
    encode_dock,
    encode_undock,
)
from fasaco_edge.wire.messages.follow_path import (
    GOAL_ID_BYTES,
    decode_accepted,
    decode_cancel,
    encode_cancel,
    encode_goal_id,
)
from fasaco_edge.wire.ros_actions import DOCK_ROBOT, UNDOCK_ROBOT, Call

log = logging.getLogger(__name__)


class DockingNode:
    """Takes the daemon's state and the robot's pose, and has the docking server move the robot."""

    def __init__(self, bus: Bus, settings: FollowSettings) -> None:
        dock: Any = settings.dock
        self._dock = dock
        self._pose = Pose2D(*dock["pose"])
        self._actions = {Move.DOCK: dock["dock_action"], Move.UNDOCK: dock["undock_action"]}
        types = {Move.DOCK: DOCK_ROBOT, Move.UNDOCK: UNDOCK_ROBOT}
        self._clients = {
            move: ActionClient(bus, settings.ros, name, types[move])
            for move, name in self._actions.items()
        }
        new_id = partial(os.urandom, GOAL_ID_BYTES)
        self._docking = Docking(self._pose, dock["approach_m"], new_id)
        # Replies of the server, from Zenoh's threads.
        self._answers = deque[Callable[[], None]]()
        self._said = ("", "")

    def turn(self, inputs: Inputs, follower: Supervision) -> None:
        """Run a cycle; the follower is held while the docking server moves the robot."""
        for client in self._clients.values():
            client.look()
        while self._answers:
            self._answers.popleft()()
        requests = self._docking.step(
            time.monotonic(),
            inputs.daemon_state,
            follower.newest_pose,
            drives=follower.has_path,
        )
        follower.hold(self._docking.holds)
        for request in requests:
            self._ask(request)
        self._say()

    def end(self) -> None:
        """End the goals."""
        for request in self._docking.end():
            self._ask(request)

    def _say(self) -> None:
        """Log what happens, and errors."""
        docking, told = self._docking, self._said
        self._said = (docking.holds, docking.trouble)
        if docking.trouble and docking.trouble != told[1]:
            log.warning("dock: %s", docking.trouble)
        if docking.holds and docking.holds != told[0]:
            log.info("dock: %s", docking.holds)

    def _ask(self, request: DockRequest) -> None:

        dock, client = self._dock, self._clients[request.move]
        if isinstance(request, Start):
            call: Call = "send_goal"
            if request.move is Move.DOCK:
                names = dock["id"], dock["type"]
                payload = encode_dock(request.id, self._pose, dock["frame"], *names)
            else:
                payload = encode_undock(request.id, dock["type"])
        elif isinstance(request, Ask):
            call, payload = "get_result", encode_goal_id(request.id)
        else:
            call, payload = "cancel_goal", encode_cancel(request.id)
        keys = client.keys()
        if call not in keys:
            self._answers.append(partial(self._take, request, []))
            return
        client.ask(
            keys[call],
            call,
            payload,
            lambda replies: self._answers.append(partial(self._take, request, replies)),
        )

    def _take(self, request: DockRequest, replies: list[Reply]) -> None:
        """Pass the result of a request on."""

        docking, now = self._docking, time.monotonic()
        payload = next((reply.payload for reply in replies if not reply.is_error), None)
        why = f"{self._actions[request.move]} did not answer"
        try:
            if isinstance(request, Start):
                accepted = None if payload is None else decode_accepted(payload)
                docking.take_accepted(request.id, accepted, why if accepted is None else "", now)
            elif isinstance(request, Ask):
                read = decode_dock_ending if request.move is Move.DOCK else decode_undock_ending
                # Without an answer the result is queried again.
                if payload is not None:
                    docking.take_ending(request.id, read(payload), "", now)
            else:
                code = None if payload is None else decode_cancel(payload)
                docking.take_cancelled(request.id, code)
        except MalformedMessage as error:
            if isinstance(request, Start):
                docking.take_accepted(request.id, None, str(error), now)
            elif isinstance(request, Ask):
                docking.take_ending(request.id, None, str(error), now)
