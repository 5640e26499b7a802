"""Server of the page: HTTP for the page, a WebSocket for each viewer.

The page is one file, which loads nothing from other servers.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import logging
import signal
import ssl
import threading
from collections.abc import Callable
from http import HTTPStatus
from importlib.resources import files

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from fasaco_edge.bus.queries import QueryReply
from fasaco_edge.client.feed import Feed
from fasaco_edge.client.phrases import steady_now
from fasaco_edge.host.addresses import Address
from fasaco_edge.host.processes import release_unused
from fasaco_edge.serve.guard import Guard, is_same_origin
from fasaco_edge.serve.messages import Role
from fasaco_edge.serve.served_view import ServedView
from fasaco_edge.serve.viewer import Source, Viewer, closing_on_error
from fasaco_edge.wire.topics import FLOOR, PHEROMONE, UNSWEPT

# Files of the page's script, which are concatenated in this order.
SCRIPTS = (
    "model.js",
    "view.js",
    "picture.js",
    "drawing.js",
    "panel.js",
    "rooms.js",
    "orders.js",
    "timeline.js",
    "link.js",
)


def load_page() -> tuple[bytes, str]:
    """Return the page's HTML with style and script, and its Content-Security-Policy.

    The policy lacks connect-src.
    """
    folder = files("fasaco_edge.serve").joinpath("page")
    style = folder.joinpath("style.css").read_text(encoding="utf-8")
    parts = (folder.joinpath(name).read_text(encoding="utf-8") for name in SCRIPTS)
    script = '"use strict";\n' + "\n".join(parts)
    html = folder.joinpath("page.html").read_text(encoding="utf-8")
    html = html.replace("/* style */", style).replace("/* script */", script)
    policy = (
        f"default-src 'none'; script-src '{_digest(script)}'; style-src '{_digest(style)}'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return html.encode(), policy


def _digest(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


LOG = logging.getLogger(__name__)

MOST_VIEWERS = 20
# Limit on unauthenticated connections. Beyond it the oldest one is closed: a page sends its token
# at once, so it is not affected.
MOST_STRANGERS = 20
# Limit on a message of a page [bytes]: the longest order has a few hundred kilobytes.
MOST_BYTES = 262_144
# Timeouts of the handshake, and of a viewer that does not answer pings [s].
OPEN_S, PING_S = 5.0, 15.0
# Send buffer for each viewer, besides the message being sent [bytes].
WAITING_BYTES = 65_536


class Server:
    """Serves one robot's page.

    Args:
        guard: decides the rights of clients.
        source_of: returns the source of messages for a new viewer.
    """

    def __init__(self, guard: Guard, source_of: Callable[[], Source]) -> None:
        self._guard = guard
        self._source_of = source_of
        self._page, self._policy = load_page()
        self._viewers: set[Viewer] = set()
        # Unauthenticated connections, in order of arrival.
        self._strangers: dict[Viewer, ServerConnection] = {}
        self._ended = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None

    async def run(
        self,
        address: Address,
        secured: ssl.SSLContext | None = None,
        *,
        ready: Callable[[], None] = lambda: None,
    ) -> None:
        """Serve until SIGTERM or SIGINT; call ``ready`` once the server listens.

        Raises:
            OSError: the server cannot listen at ``address``.
        """
        self._loop = asyncio.get_running_loop()
        stop = asyncio.Event()
        for number in (signal.SIGTERM, signal.SIGINT):
            self._loop.add_signal_handler(number, stop.set)
        async with serve(
            self._attend,
            *address,
            ssl=secured,
            process_request=self._answer,
            compression=None,  # large messages are compressed once, for all viewers
            server_header=None,
            open_timeout=OPEN_S,
            ping_interval=PING_S,
            ping_timeout=PING_S,
            close_timeout=1.0,
            max_size=MOST_BYTES,
            max_queue=4,
            write_limit=WAITING_BYTES,
        ):
            ready()
            release_unused()
            working = asyncio.create_task(asyncio.to_thread(self._work))
            # If the thread fails, the server ends: a page must not show old data.
            working.add_done_callback(lambda _: stop.set())
            await stop.wait()
            self._ended.set()
        await working

    def _work(self) -> None:
        """Do the server's work, in a thread of its own, until the server ends."""
        self._ended.wait()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the response to a request; None accepts it as a WebSocket."""
        hosts = request.headers.get_all("Host")
        host = hosts[0] if len(hosts) == 1 else ""
        if not self._guard.is_ours(host):
            why = "unknown host: open the page by its address, or name it with --name"
            return self._response(HTTPStatus.MISDIRECTED_REQUEST, why)
        place = request.path.partition("?")[0]
        if place == "/":
            return self._response(HTTPStatus.OK, self._page, host)
        if place != "/live":
            return self._response(HTTPStatus.NOT_FOUND, "the page is at /")
        if not is_same_origin(request.headers.get_all("Origin"), host):
            return self._response(HTTPStatus.FORBIDDEN, "a page of another server")
        if len(self._viewers) >= MOST_VIEWERS:
            why = f"there are {MOST_VIEWERS} viewers already"
            return self._response(HTTPStatus.SERVICE_UNAVAILABLE, why)
        return None

    def _response(self, status: HTTPStatus, body: str | bytes, host: str = "") -> Response:
        is_page = isinstance(body, bytes)
        content = body if isinstance(body, bytes) else f"{body}\n".encode()
        # In old browsers 'self' does not include WebSockets.
        policy = f"{self._policy}; connect-src 'self' ws://{host} wss://{host}"
        headers = {
            "Content-Type": "text/html; charset=utf-8" if is_page else "text/plain; charset=utf-8",
            "Content-Length": str(len(content)),
            "Content-Security-Policy": policy if is_page else "default-src 'none'",
            "Cache-Control": "no-store",
            "Connection": "close",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
        }
        return Response(status.value, status.phrase, Headers(headers), content)

    async def _attend(self, socket: ServerConnection) -> None:
        viewer = Viewer(socket, self._source_of(), self._guard)
        try:
            async with closing_on_error(socket):
                role = await self._greet(viewer, socket)
                if role is None:
                    return
                self._viewers.add(viewer)
                await viewer.serve(role)
        except ConnectionClosed:
            LOG.debug("a viewer is gone")
        finally:
            self._viewers.discard(viewer)

    async def _greet(self, viewer: Viewer, socket: ServerConnection) -> Role | None:
        """Return the role of a viewer; None if it is rejected."""
        self._strangers[viewer] = socket
        if len(self._strangers) > MOST_STRANGERS:
            oldest = next(iter(self._strangers))
            self._strangers.pop(oldest).transport.abort()
        try:
            role = await viewer.greet()
        finally:
            self._strangers.pop(viewer, None)
        if role is not None and len(self._viewers) >= MOST_VIEWERS:
            await socket.close(CloseCode.TRY_AGAIN_LATER)
            return None
        return role


# Least period of messages to viewers, and longest wait for samples [s].
FRAME_S, IDLE_S = 0.1, 0.2


class LiveServer(Server):
    """Serves the page of a robot on the bus; it is the source of all its viewers.

    Args:
        feed: samples of the robot.
        view: makes messages from the samples.
        guard: decides the rights of clients.
    """

    def __init__(self, feed: Feed, view: ServedView, guard: Guard) -> None:
        super().__init__(guard, lambda: self)
        self._feed = feed
        self._view = view
        self._newest: dict[str, tuple[int, str | bytes]] = {}

    def newest(self) -> list[tuple[str, int, str | bytes]]:
        return [(kind, number, message) for kind, (number, message) in self._newest.items()]

    def ask(self, query: str, payload: bytes, timeout_s: float) -> list[QueryReply]:
        return self._feed.ask(query, payload, timeout_s)

    def at(self, _: float) -> list[str | bytes]:
        """Return nothing: only recordings have other times than the present."""
        return []

    def _work(self) -> None:
        """Take in samples; make messages while there are viewers."""
        while not self._ended.is_set():
            items = self._feed.take(IDLE_S)
            now = steady_now()
            for topic, item in items:
                self._view.take(topic, item, now)
            self._view.trouble = self._feed.trouble
            viewers = tuple(self._viewers)
            self._feed.want(FLOOR, bool(viewers))
            self._feed.want(UNSWEPT, any(viewer.wants_unswept for viewer in viewers))
            self._feed.want(PHEROMONE, any(viewer.wants_field for viewer in viewers))
            if viewers and (news := self._view.news(now)) and self._loop is not None:
                self._loop.call_soon_threadsafe(self._publish, news)
            self._ended.wait(max(FRAME_S - (steady_now() - now), 0.0))

    def _publish(self, news: dict[str, str | bytes]) -> None:
        for kind, message in news.items():
            number, _ = self._newest.get(kind, (0, b""))
            self._newest[kind] = number + 1, message
        for viewer in self._viewers:
            viewer.news.set()
