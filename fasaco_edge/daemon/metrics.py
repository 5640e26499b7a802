"""The metrics server for Prometheus: the newest status, over HTTP, on a thread of its own.

It never blocks the loop: the loop only passes a reference. It never blocks on a connection: it
polls them a few times a second and answers all complete requests, so a client that polls in a
tight loop costs little CPU.
"""

from __future__ import annotations

import fcntl
import functools
import logging
import select
import socket
import struct
import sys
import termios
import threading
import time
from collections.abc import Iterator

from fasaco_edge.daemon.exposition import CONTENT_TYPE, exposition
from fasaco_edge.host.addresses import Address
from fasaco_edge.wire.documents.status import Status

LOG = logging.getLogger(__name__)

PATH = "/metrics"
# Limit on the bytes of a request; timeout of its arrival, and of the delivery of its answer [s].
MOST_BYTES, LONGEST_S = 8192, 1.0
# Pause between two polls [s]. Limit on the connections that wait for a poll and are accepted in it.
# Limit on open connections: beyond it the oldest are closed.
PAUSE_S, MOST_TAKEN, MOST_OPEN = 0.05, 64, 16
# Send buffer, which holds a whole answer [bytes].
ANSWER_BYTES = 1 << 17
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
        self._socket = socket.create_server(address, family=family, backlog=MOST_TAKEN)
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
        requests: list[_Request] = []
        while not self._is_closed.is_set():
            self._wait(requests)
            requests += self._taken()
            for request in requests:
                request.read()
            self._answer(requests)
            requests = _kept(requests)
            self._is_closed.wait(PAUSE_S)
        for request in requests:
            request.close()

    def _wait(self, requests: list[_Request]) -> None:
        """Wait for data, or for the timeout of a request."""
        # select(2) is not used, as it takes only descriptors below 1024.
        arrivals = select.poll()
        try:
            arrivals.register(self._socket, select.POLLIN)
            for request in requests:
                arrivals.register(request, select.POLLIN)
            arrivals.poll(LONGEST_S * 1e3 if requests else None)
        except (OSError, ValueError) as error:
            LOG.debug("metrics: %s", error)  # the socket is closed

    def _taken(self) -> Iterator[_Request]:
        """Accept waiting connections."""
        for _ in range(MOST_TAKEN):
            try:
                connection, _ = self._socket.accept()
            except OSError as error:
                # No connection is waiting any more, the socket is closed, or no descriptor is left.
                LOG.debug("metrics: %s", error)
                return
            yield _Request(connection)

    def _answer(self, requests: list[_Request]) -> None:
        """Answer the complete requests."""
        page = functools.cache(self._page)
        for request in requests:
            if request.is_whole and not request.is_answered:
                request.answer(*page(*request.words()))

    def _page(self, method: str, path: str) -> tuple[int, str]:
        if method not in ("GET", "HEAD"):
            return 405, "only GET and HEAD\n"
        if path != PATH:
            return 404, f"the figures are at {PATH}\n"
        if self._shown is None:
            return 503, "no status yet\n"
        status, at = self._shown
        return 200, exposition(status, time.monotonic() - at)


def _kept(requests: list[_Request]) -> list[_Request]:
    """Close finished and expired requests, and the oldest beyond the limit; return the rest."""
    now = time.monotonic()
    waiting = [request for request in requests if not request.is_over(now)]
    kept = sorted(waiting, key=lambda request: request.until)[-MOST_OPEN:]
    for request in set(requests) - set(kept):
        request.close()
    return kept


class _Request:
    """The received part of one request, and its answer.

    Attributes:
        until: deadline of its arrival, then of the delivery of its answer, monotonic [s].
        is_answered: whether its answer was sent.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._connection, self._head, self._is_gone = connection, b"", False
        self.until, self.is_answered = time.monotonic() + LONGEST_S, False

    def fileno(self) -> int:
        """Return the connection's descriptor."""
        return self._connection.fileno()

    @property
    def is_whole(self) -> bool:
        """Whether it is complete, or the size limit is reached."""
        return b"\r\n\r\n" in self._head or len(self._head) >= MOST_BYTES

    def is_over(self, now: float) -> bool:
        """Return whether it has expired, its answer is delivered, or the client is gone."""
        if now > self.until:
            return True
        return not self._unsent() if self.is_answered else self._is_gone

    def read(self) -> None:
        """Read the available bytes."""
        if self.is_whole:
            return
        try:
            part = self._connection.recv(MOST_BYTES - len(self._head))
        except BlockingIOError:
            return
        except OSError:
            part = b""
        self._head, self._is_gone = self._head + part, not part

    def words(self) -> tuple[str, str]:
        """Return method and path."""
        method, _, rest = self._head.split(b"\r\n", 1)[0].decode("latin-1").partition(" ")
        return method, rest.partition(" ")[0].partition("?")[0]

    def answer(self, code: int, body: str) -> None:
        """Send the answer, without waiting for its delivery."""
        text = body.encode()
        lines = (
            f"HTTP/1.0 {code} {REASONS[code]}",
            f"Content-Type: {CONTENT_TYPE}",
            f"Content-Length: {len(text)}",
            "Connection: close",
            *(["Allow: GET, HEAD"] if code == 405 else ()),
        )
        head = "\r\n".join((*lines, "", "")).encode()
        self.is_answered, self.until = True, time.monotonic() + LONGEST_S
        try:
            self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, ANSWER_BYTES)
            self._connection.send(head if self.words()[0] == "HEAD" else head + text)
        except OSError as error:
            LOG.debug("metrics: %s", error)  # the client is gone

    def _unsent(self) -> int:
        """Return how much of the answer the client has not acknowledged [bytes]."""
        try:
            said = fcntl.ioctl(self._connection, termios.TIOCOUTQ, bytes(4))
        except OSError:
            return 0
        return int.from_bytes(said, sys.byteorder)

    def close(self) -> None:
        """Close the connection, discarding data that the kernel would keep for minutes."""
        if self._unsent():
            at_once = struct.pack("ii", 1, 0)
            self._connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, at_once)
        self._connection.close()


def serve_metrics(address: Address | None) -> MetricsServer | None:
    """Return a server; None if none is configured or it cannot listen: a robot also drives without.

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
