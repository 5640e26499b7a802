"""The metrics server for Prometheus: the newest status, over HTTP, on a thread of its own.

It never blocks the loop: the loop only passes a reference. It never blocks on a connection:
complete requests are answered one at a time, rate-limited, so a client that polls in a tight loop
costs little CPU.
"""

from __future__ import annotations

import logging
import select
import socket
import threading
import time

from fasaco_edge.daemon.exposition import CONTENT_TYPE, exposition
from fasaco_edge.host.addresses import Address
from fasaco_edge.wire.documents.status import Status

LOG = logging.getLogger(__name__)

PATH = "/metrics"
# Of a request: most bytes read, timeout of its arrival [s], timeout of sending the answer [s].
MOST_BYTES, LONGEST_S, SEND_S = 8192, 1.0, 0.2
# Pause between two answers [s]. Most open connections, and most that wait to be accepted: beyond
# that the oldest, silent for the longest, is closed.
PAUSE_S, MOST_OPEN = 0.05, 16
REASONS = {200: "OK", 404: "Not Found", 405: "Method Not Allowed", 503: "Service Unavailable"}


class MetricsServer:
    """Serves the newest status it was given.

    Args:
        address: where to listen.

    Raises:
        OSError: it cannot listen there.
    """

    def __init__(self, address: Address) -> None:
        family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        self._socket = socket.create_server(address, family=family, backlog=MOST_OPEN)
        self._socket.setblocking(False)
        self._shown: tuple[Status, float] | None = None
        self._is_closed = threading.Event()
        threading.Thread(target=self._serve, name="metrics", daemon=True).start()

    def show(self, status: Status) -> None:
        """Serve this status from now on."""
        self._shown = status, time.monotonic()

    def close(self) -> None:
        """Stop listening; a connection that is open ends with the process, or within a second."""
        self._is_closed.set()
        # Closing the socket alone does not wake the thread waiting on it.
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            LOG.debug("metrics: already shut down")
        self._socket.close()

    def _serve(self) -> None:
        requests: dict[socket.socket, _Request] = {}
        while not self._is_closed.is_set():
            try:
                wait_s = LONGEST_S if requests else None
                readable, _, _ = select.select([self._socket, *requests], [], [], wait_s)
            except (OSError, ValueError) as error:
                LOG.debug("metrics: %s", error)  # the socket is closed
                continue
            if self._socket in readable:
                self._take(requests)
            for connection in readable:
                if connection in requests:
                    requests[connection].read()
            self._answer_one(requests)
            self._is_closed.wait(PAUSE_S)
        for request in requests.values():
            request.close()

    def _take(self, requests: dict[socket.socket, _Request]) -> None:
        """Accept waiting connections; close the oldest if there are too many."""
        for _ in range(MOST_OPEN):
            try:
                connection, _ = self._socket.accept()
            except OSError as error:
                # No more wait, or the socket is closed, or there are no descriptors left.
                LOG.debug("metrics: %s", error)
                break
            requests[connection] = _Request(connection)
        while len(requests) > MOST_OPEN:
            requests.pop(next(iter(requests))).close()

    def _answer_one(self, requests: dict[socket.socket, _Request]) -> None:
        """Answer the oldest complete request; close expired connections."""
        now, has_answered = time.monotonic(), False
        for connection, request in list(requests.items()):
            if request.is_whole and not has_answered:
                request.answer(*self._page(*request.words()))
                has_answered = True
            elif not (request.is_gone or now > request.until):
                continue
            requests.pop(connection).close()

    def _page(self, method: str, path: str) -> tuple[int, str]:
        if method not in ("GET", "HEAD"):
            return 405, "only GET and HEAD\n"
        if path != PATH:
            return 404, f"the figures are at {PATH}\n"
        if self._shown is None:
            return 503, "no status yet\n"
        status, at = self._shown
        return 200, exposition(status, time.monotonic() - at)


class _Request:
    """The received part of one request.

    Attributes:
        until: deadline of its arrival, monotonic [s].
        is_gone: the client is gone.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._connection, self._head = connection, b""
        self.until, self.is_gone = time.monotonic() + LONGEST_S, False

    @property
    def is_whole(self) -> bool:
        """Whether it is complete, or the size limit is reached."""
        return b"\r\n\r\n" in self._head or len(self._head) >= MOST_BYTES

    def read(self) -> None:
        """Read the available bytes."""
        if self.is_whole:
            return
        try:
            part = self._connection.recv(1024)
        except BlockingIOError:
            return
        except OSError:
            part = b""
        self._head, self.is_gone = self._head + part, not part

    def words(self) -> tuple[str, str]:
        """Return method and path."""
        method, _, rest = self._head.split(b"\r\n", 1)[0].decode("latin-1").partition(" ")
        return method, rest.partition(" ")[0].partition("?")[0]

    def answer(self, code: int, body: str) -> None:
        """Send as much of the answer as the socket takes at once."""
        text = body.encode()
        lines = (
            f"HTTP/1.0 {code} {REASONS[code]}",
            f"Content-Type: {CONTENT_TYPE}",
            f"Content-Length: {len(text)}",
            "Connection: close",
            *(["Allow: GET, HEAD"] if code == 405 else ()),
        )
        head = "\r\n".join((*lines, "", "")).encode()
        try:
            self._connection.settimeout(SEND_S)
            self._connection.sendall(head if self.words()[0] == "HEAD" else head + text)
        except OSError as error:
            LOG.debug("metrics: %s", error)  # the client is gone, or too slow

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def serve_metrics(address: Address | None) -> MetricsServer | None:
    """Return a server; None if none is configured or it cannot listen: a robot drives without.

    Args:
        address: where to listen; None for no server.
    """
    if address is None:
        return None
    try:
        server = MetricsServer(address)
    except OSError as error:
        said = "metrics.listen: cannot listen on %s port %d, no figures are served: %s"
        LOG.error(said, *address, error, extra={"event": "metrics"})
        return None
    LOG.info("figures at %s port %d, %s", *address, PATH, extra={"event": "metrics"})
    return server
