"""Imitation of the action server in Nav2's controller, without code of this project.

It uses plain Zenoh and payloads by rosbags. It follows rmw_zenoh_cpp (rmw_service_data.cpp),
rcl_action (goals, results) and nav2_util/nav2_ros_common (SimpleActionServer: one goal is driven,
one waits, and a third replaces the waiting goal). Like these, it does not answer a request without
attachment, with a repeated number, or that cannot be deserialised.
"""

from __future__ import annotations

import json
import random
import struct
import threading
import time
from dataclasses import dataclass, field
from typing import Any

import zenoh
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

PATH_IDS = {
    "humble": ("controller_id", "goal_checker_id"),
    "jazzy": ("controller_id", "goal_checker_id", "progress_checker_id"),
    "lyrical": ("controller_id", "goal_checker_id", "progress_checker_id", "path_handler_id"),
}
RESULTS = {
    "humble": "",
    "jazzy": "uint16 error_code\nstring error_msg\n",
    "lyrical": "uint16 error_code\nstring error_msg\n",
}
# Type hashes of the three services, computed in tests/wire/test_ros_actions.py; Humble has none.
HASHES = {
    "jazzy": (
        "RIHS01_5b662aee1159e1d7e7b5f8fef21f556b8bc67c818c730a68e18bb29b85f66946",
        "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
        "RIHS01_8ab4c588c878f0e997316ec559f172bb56fc210b484c2f6b280d391d3bd6890f",
    ),
    "lyrical": (
        "RIHS01_0c091793c90a67349df3445771d5d30005daea785137bd6e6bf5d96ea53fb721",
        "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
        "RIHS01_8ab4c588c878f0e997316ec559f172bb56fc210b484c2f6b280d391d3bd6890f",
    ),
    "humble": ("TypeHashNotSupported",) * 3,
}
TYPES = (
    ("send_goal", "nav2_msgs::action::dds_::FollowPath_SendGoal_"),
    ("cancel_goal", "action_msgs::srv::dds_::CancelGoal_"),
    ("get_result", "nav2_msgs::action::dds_::FollowPath_GetResult_"),
)
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
# action_server_result_timeout of Nav2's servers [s].
RESULT_KEPT_S = 10.0


def store_of(release: str) -> Any:
    """Return rosbags' types, including those of the action."""
    names = "".join(f"string {name}\n" for name in PATH_IDS[release])
    store = get_typestore(Stores.ROS2_JAZZY)
    definitions = {
        "Send": f"unique_identifier_msgs/UUID goal_id\nnav_msgs/Path path\n{names}",
        "Sent": "bool accepted\nbuiltin_interfaces/Time stamp\n",
        "Ask": "unique_identifier_msgs/UUID goal_id\n",
        "Ended": f"int8 status\nstd_msgs/Empty result\n{RESULTS[release]}",
        "Cancel": "action_msgs/GoalInfo goal_info\n",
        "Canceled": "int8 return_code\naction_msgs/GoalInfo[] goals_canceling\n",
    }
    for name, text in definitions.items():
        store.register(get_types_from_msg(text, f"look_alike/msg/{name}"))
    return store


@dataclass
class Faults:
    """Faults: largest delay of requests and replies [s]; share of replies that are lost."""

    delay_s: float = 0.0
    lost: float = 0.0
    seed: int = 0


@dataclass
class Handle:
    """A goal on the server."""

    id: bytes
    message: Any
    is_canceling: bool = False
    status: int = 0
    ended_at: float = 0.0
    code: int = 0
    text: str = ""
    # Time of its request, and delay until the goal was accepted [s].
    asked_at: float = 0.0
    delay_s: float = 0.0
    waiting: list[tuple[Any, bytes]] = field(default_factory=list)


class ActionServer:
    """The services of ``follow_path``, and the present goal."""

    def __init__(
        self, endpoint: str, domain: int | None, release: str, faults: Faults, action: str
    ) -> None:
        self.store = store_of(release)
        self.release = release
        self.lock = threading.RLock()
        self.current: Handle | None = None
        self.pending: Handle | None = None
        self.refused: list[str] = []
        self.counts = {"goals": 0, "preempted": 0, "canceled": 0}
        self._goals: dict[bytes, Handle] = {}
        self._seen: set[tuple[bytes, int]] = set()
        self._faults = faults
        self._random = random.Random(faults.seed)
        self._domain, self._action = domain, action
        self._session = open_session(endpoint)
        self._declared: list[Any] = []
        session_id = str(self._session.zid())
        mangled = action.replace("/", "%")
        for number, ((call, kind), type_hash) in enumerate(
            zip(TYPES, HASHES[release], strict=True), start=1
        ):
            key = f"{action.strip('/')}/_action/{call}"
            if domain is not None:
                key = f"{domain}/{key}/{kind}/{type_hash}"
                token = (
                    f"@ros2_lv/{domain}/{session_id}/0/{number}/SS/%/%/controller_server/"
                    f"{mangled}%_action%{call}/{kind}/{type_hash}/::,10:,:,:,,"
                )
                self._declared.append(self._session.liveliness().declare_token(token))
            answer = getattr(self, f"_{call}")
            self._declared.append(
                self._session.declare_queryable(
                    key, lambda query, answer=answer, key=key: self._later(query, key, answer),
                    complete=True,
                )
            )  # fmt: skip

    def close(self) -> None:
        """Close, as a process does when it ends; goals are lost."""
        for declared in self._declared:
            declared.undeclare()
        self._declared.clear()
        self._session.close()  # type: ignore[no-untyped-call]

    def end(self, handle: Handle, status: int, code: int = 0, text: str = "") -> None:
        """End a goal; send its result to all clients that wait for it."""
        with self.lock:
            handle.status, handle.code, handle.text = status, code, text
            handle.ended_at = time.monotonic()
            waiting, handle.waiting = handle.waiting, []
            if self.current is handle:
                self.current = None
            if self.pending is handle:
                self.pending = None
        for query, beside in waiting:
            self._reply(query, self._ended(handle), beside)

    def accept_pending(self) -> Handle:
        """Drive the waiting goal; the previous goal ends as aborted, without a code."""
        with self.lock:
            assert self.pending is not None
            before, self.current, self.pending = self.current, self.pending, None
            now = self.current
        if before is not None:
            self.counts["preempted"] += 1
            self.end(before, CANCELED if before.is_canceling else ABORTED)
            self.current = now
        return now

    def _later(self, query: Any, key: str, answer: Any) -> None:
        request = query.payload.to_bytes() if query.payload is not None else b""
        beside = query.attachment.to_bytes() if query.attachment is not None else b""
        if self._domain is not None and not self._is_taken(beside):
            return

        asked_at = time.monotonic()

        def work() -> None:
            try:
                answer(query, request, beside, asked_at)
            except Exception as error:  # rosbags cannot deserialise the request
                self.refused.append(f"{key}: {error!r}")

        self._after(work)

    def _is_taken(self, beside: bytes) -> bool:
        """Check the attachment as rmw_zenoh does."""
        if len(beside) != 33 or beside[16] != 16:
            self.refused.append(f"attachment {beside.hex()}")
            return False
        number, stamp = struct.unpack_from("<qq", beside)
        key = (beside[17:], number)
        if number < 0 or stamp < 0 or key in self._seen:
            self.refused.append(f"number {number} at {stamp}")
            return False
        self._seen.add(key)
        return True

    def _after(self, work: Any) -> None:
        delay_s = self._faults.delay_s * self._random.random()
        if not delay_s:
            work()
            return
        timer = threading.Timer(delay_s, work)
        timer.daemon = True
        timer.start()

    def _send_goal(self, query: Any, request: bytes, beside: bytes, asked_at: float) -> None:
        message = self._read("Send", request)
        goal_id = bytes(message.goal_id.uuid)
        with self.lock:
            accepted = goal_id not in self._goals
            if accepted:
                handle = self._goals[goal_id] = Handle(goal_id, message, asked_at=asked_at)
                handle.delay_s = time.monotonic() - asked_at
                replaced, self.pending = self.pending, handle
                self.counts["goals"] += 1
        stamp = self.store.types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
        self._reply(query, self._write("Sent", accepted=accepted, stamp=stamp), beside)
        if accepted and replaced is not None:
            self.end(replaced, ABORTED)

    def _get_result(self, query: Any, request: bytes, beside: bytes, _: float) -> None:
        goal_id = bytes(self._read("Ask", request).goal_id.uuid)
        with self.lock:
            handle = self._goals.get(goal_id)
            if handle is not None and not handle.status:
                handle.waiting.append((query, beside))
                return
        kept = handle is not None and time.monotonic() - handle.ended_at < RESULT_KEPT_S
        self._reply(query, self._ended(handle if kept else None), beside)

    def _cancel_goal(self, query: Any, request: bytes, beside: bytes, _: float) -> None:
        info = self._read("Cancel", request).goal_info
        handle = self._goals.get(bytes(info.goal_id.uuid))
        assert (info.stamp.sec, info.stamp.nanosec) == (0, 0)
        code, canceling = 2, []
        if handle is not None:
            code = 3 if handle.status else 0
            if not handle.status:
                handle.is_canceling = True
                self.counts["canceled"] += 1
                canceling = [info]
        self._reply(
            query, self._write("Canceled", return_code=code, goals_canceling=canceling), beside
        )

    def _ended(self, handle: Handle | None) -> bytes:
        empty = self.store.types["std_msgs/msg/Empty"]()
        members = {"status": handle.status if handle else 0, "result": empty}
        if self.release != "humble":
            members["error_code"] = handle.code if handle else 0
            members["error_msg"] = handle.text if handle else ""
        return self._write("Ended", **members)

    def _reply(self, query: Any, payload: bytes, beside: bytes) -> None:
        def reply() -> None:
            if self._random.random() >= self._faults.lost:
                try:
                    query.reply(str(query.key_expr), payload, attachment=beside or None)
                    query.drop()
                except zenoh.ZError:
                    return  # the server or the client has closed
            else:
                LOST.append(query)  # kept, so that it never ends, and the client waits

        self._after(reply)

    def _read(self, name: str, payload: bytes) -> Any:
        return self.store.deserialize_cdr(payload, f"look_alike/msg/{name}")

    def _write(self, name: str, **members: Any) -> bytes:
        schema = f"look_alike/msg/{name}"
        message = self.store.types[schema](**members)
        return bytes(self.store.serialize_cdr(message, schema, little_endian=True))


# Queries whose replies were lost.
LOST: list[Any] = []


def open_session(endpoint: str) -> zenoh.Session:
    """Return a client session."""
    document = {
        "mode": "client",
        "connect": {"endpoints": [endpoint]},
        "scouting": {"multicast": {"enabled": False}},
        "timestamping": {"enabled": True},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(document)))
