"""The server of the page: HTTP for the page, a WebSocket for each viewer."""

from __future__ import annotations

import asyncio
import logging
import signal
import ssl
import threading
from collections.abc import Callable
from http import HTTPStatus

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from fasaco_edge.host.addresses import Address
from fasaco_edge.host.processes import release_unused
from fasaco_edge.serve.guard import Guard, is_same_origin
from fasaco_edge.serve.messages import Role
from fasaco_edge.serve.page import load_page
from fasaco_edge.serve.viewer import Source, Viewer, closing_on_error

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
        self._page = load_page()
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
            return self._response(HTTPStatus.OK, self._page.body, host)
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
        policy = f"{self._page.policy}; connect-src 'self' ws://{host} wss://{host}"
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
