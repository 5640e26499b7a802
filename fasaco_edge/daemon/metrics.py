"""The server of figures for Prometheus: the newest status, over HTTP, on a thread of its own.

It cannot hold the loop up: the loop hands over a reference and goes on. One connection at a time,
a second for each, and a pause after it, so that who asks without end gets a few answers a second
and takes hardly any of the processor.
"""

from __future__ import annotations

import logging
import socket
import threading
import time

from fasaco_edge.daemon.exposition import CONTENT_TYPE, exposition
from fasaco_edge.host.addresses import Address
from fasaco_edge.wire.documents.status import Status

LOG = logging.getLogger(__name__)

PATH = "/metrics"
# Of a request: how much is read of it, and how long it may take with its answer [s].
MOST_BYTES, LONGEST_S = 8192, 1.0
# After each connection [s]; so many others may wait meanwhile.
PAUSE_S, WAITING = 0.05, 8
REASONS = {200: "OK", 404: "Not Found", 405: "Method Not Allowed", 503: "Service Unavailable"}


class MetricsServer:
    """Serves the newest status that it was shown.

    Args:
        address: where to listen.

    Raises:
        OSError: it cannot listen there.
    """

    def __init__(self, address: Address) -> None:
        family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        self._socket = socket.create_server(address, family=family, backlog=WAITING)
        self._shown: tuple[Status, float] | None = None
        self._is_closed = threading.Event()
        threading.Thread(target=self._serve, name="metrics", daemon=True).start()

    def show(self, status: Status) -> None:
        """Serve this status from now on."""
        self._shown = status, time.monotonic()

    def close(self) -> None:
        """Stop listening; a connection that is open ends with the process, or within a second."""
        self._is_closed.set()
        # To close the socket alone does not wake who waits at it.
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            LOG.debug("metrics: already shut down")
        self._socket.close()

    def _serve(self) -> None:
        while not self._is_closed.is_set():
            try:
                connection, _ = self._socket.accept()
                with connection:
                    self._answer(connection)
            except OSError as error:
                # Who asked is gone or too slow, or there are no descriptors left for now.
                LOG.debug("metrics: %s", error)
            self._is_closed.wait(PAUSE_S)

    def _answer(self, connection: socket.socket) -> None:
        until = time.monotonic() + LONGEST_S
        head = b""
        while b"\r\n\r\n" not in head and len(head) < MOST_BYTES:
            connection.settimeout(_left(until))
            part = connection.recv(1024)
            if not part:
                return
            head += part
        method, _, rest = head.split(b"\r\n", 1)[0].decode("latin-1").partition(" ")
        code, body = self._page(method, rest.partition(" ")[0].partition("?")[0])
        text = body.encode()
        lines = (
            f"HTTP/1.0 {code} {REASONS[code]}",
            f"Content-Type: {CONTENT_TYPE}",
            f"Content-Length: {len(text)}",
            "Connection: close",
            *(["Allow: GET, HEAD"] if code == 405 else ()),
        )
        answer = "\r\n".join((*lines, "", "")).encode()
        connection.settimeout(_left(until))
        connection.sendall(answer if method == "HEAD" else answer + text)

    def _page(self, method: str, path: str) -> tuple[int, str]:
        if method not in ("GET", "HEAD"):
            return 405, "only GET and HEAD\n"
        if path != PATH:
            return 404, f"the figures are at {PATH}\n"
        if self._shown is None:
            return 503, "no status yet\n"
        status, at = self._shown
        return 200, exposition(status, time.monotonic() - at)


def _left(until: float) -> float:
    """Return the time left [s]; raise TimeoutError where there is none."""
    left = until - time.monotonic()
    if left <= 0.0:
        raise TimeoutError("too slow")
    return left


def serve_metrics(address: Address | None) -> MetricsServer | None:
    """Return a server; None where none is asked for, or it cannot listen: a robot drives without.

    Args:
        address: where to listen; None for nowhere.
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
