"""The connection of one browser: it sends messages and handles requests."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING, Protocol

import msgspec
from websockets.frames import CloseCode

from fasaco_edge.errors import FasacoError, UnreadableRecording
from fasaco_edge.serve.messages import Hello, Order, Role, Seek, Wants, from_page, message_text
from fasaco_edge.serve.plain import NEEDS
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.json_text import decode_tolerant, encode_json
from fasaco_edge.wire.documents.replies import Error
from fasaco_edge.wire.documents.replies import Reply as Answer
from fasaco_edge.wire.reasons import plain

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

    from fasaco_edge.bus.queries import QueryReply
    from fasaco_edge.serve.guard import Guard

LOG = logging.getLogger(__name__)

# Timeouts of the first message and of each message sent; delay before a token is rejected [s].
HELLO_S, SEND_S, REFUSED_S = 5.0, 10.0, 1.0
ANSWER_S = 8.0
# Period of "alive" messages while nothing else is sent [s]. After three silent periods the page
# takes the server for dead: a browser does not notice that by itself.
ALIVE_S = 5.0
# Close codes of a connection, from the range for applications.
DENIED, MALFORMED = 4401, 4400
# Commands with areas that the robot must not enter.
PLACING = ("start", "keep_out_add")


class Source(Protocol):
    """The source of messages, and receiver of commands."""

    def newest(self) -> list[tuple[str, int, str | bytes]]:
        """Return kind, number and content of the newest messages."""

    def ask(self, query: str, payload: bytes, timeout_s: float) -> list[QueryReply]:
        """Ask the daemon; blocks."""

    def at(self, at_s: float) -> list[str | bytes]:
        """Return the messages of a recording at a time since its beginning [s]; blocks.

        Raises:
            UnreadableRecording: a file can no longer be read.
        """


class Viewer:
    """The connection of one page. Nothing is queued: a page that is ready gets the newest messages.

    Attributes:
        wants_field: whether the page shows the pheromone field.
        wants_unswept: whether the page shows unswept floor.
        news: set when there are newer messages.
    """

    def __init__(self, socket: ServerConnection, source: Source, guard: Guard) -> None:
        self.wants_field = self.wants_unswept = False
        self.news = asyncio.Event()
        self._socket = socket
        self._source = source
        self._guard = guard

    async def greet(self) -> Role | None:
        """Return the page's role by its first message; None if it is rejected."""
        async with asyncio.timeout(HELLO_S):
            first = from_page(await self._socket.recv())
        role = self._guard.role_of(first.token) if isinstance(first, Hello) else None
        if role is None:
            # Limits the rate at which tokens can be guessed.
            await asyncio.sleep(REFUSED_S)
            await self._send(
                message_text("denied", asks=isinstance(first, Hello) and not first.token)
            )
            await self._socket.close(DENIED)
            return None
        await self._send(message_text("welcome", role=role))
        return role

    async def serve(self, role: Role) -> None:
        """Send new messages and handle requests until the connection ends."""
        sending = asyncio.create_task(self._send_news())
        try:
            async for text in self._socket:
                match from_page(text):
                    case Wants(field, unswept):
                        self.wants_field, self.wants_unswept = field, unswept
                        self.news.set()
                    case Seek(at_s):
                        for message in await asyncio.to_thread(self._source.at, at_s):
                            await self._send(message)
                    case Order() as order:
                        await self._send(await self._carry_out(order, role))
                    case Hello():
                        pass
        finally:
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await sending

    async def _send_news(self) -> None:
        sent: dict[str, int] = {}
        asked = {"field": lambda: self.wants_field, "unswept": lambda: self.wants_unswept}
        while True:
            self.news.clear()
            for kind, number, message in self._source.newest():
                if sent.get(kind) != number and (kind not in asked or asked[kind]()):
                    sent[kind] = number
                    await self._send(message)
            try:
                async with asyncio.timeout(ALIVE_S):
                    await self.news.wait()
            except TimeoutError:
                await self._send(message_text("alive"))

    async def _send(self, message: str | bytes) -> None:
        try:
            async with asyncio.timeout(SEND_S):
                await self._socket.send(message)
        except TimeoutError:
            LOG.info("dropped a viewer that does not read")
            self._socket.transport.abort()

    async def _carry_out(self, order: Order, role: Role) -> str:
        if role != "operator":
            why = "this page may only view; its server decides who may command"
            return message_text("answer", id=order.id, ok=False, text=why, hint="")
        asked: dict[str, object] = {"command": order.command}
        if order.command == "start":
            asked |= {"order": order.order or {}, "discard": order.discard}
        elif order.keep_out is not None:
            asked["keep_out"] = order.keep_out
        elif order.room is not None:
            asked["room"] = order.room
        try:
            payload = encode_json(asked)
            found = await asyncio.to_thread(self._source.ask, "mission", payload, ANSWER_S)
            if not found:
                why = "no answer from the daemon"
                return message_text("answer", id=order.id, ok=False, text=why, hint="")
            if found[0].is_error:
                wrong = decode_tolerant(found[0].payload, Error)
                failure = {"text": wrong.message, "hint": wrong.hint, "code": wrong.code}
                return message_text("answer", id=order.id, ok=False, **failure)
            answer = decode_tolerant(found[0].payload, Answer)
        except FasacoError as error:
            return message_text("answer", id=order.id, ok=False, text=str(error), hint=error.hint)
        text = f"{answer.state}: {plain(answer.reason)}"
        is_idle = any(each.code == "no_effect" for each in answer.troubles)
        needs = NEEDS["no_effect"] if is_idle and order.command in PLACING else ""
        return message_text("answer", id=order.id, ok=True, text=text, hint="", needs=needs)


@contextlib.asynccontextmanager
async def closing_on_error(socket: ServerConnection) -> AsyncIterator[None]:
    """Close the connection if the viewer sends an invalid message, or requests unreadable data."""
    try:
        yield
    except (msgspec.DecodeError, TimeoutError, RecursionError):
        await socket.close(MALFORMED)
    except UnreadableRecording as error:
        LOG.warning("%s", one_line(str(error)))
        await socket.close(CloseCode.INTERNAL_ERROR)
