"""Links between a session and its router, which can be cut or slowed down."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import suppress
from queue import SimpleQueue

from tests.support.processes import free_endpoint

CHUNK_BYTES = 65_536


class Link:
    """A TCP proxy in front of a router.

    Args:
        router: its endpoint.

    Attributes:
        endpoint: where sessions connect to.
        delay_s: by which what sessions send arrives late [s].
    """

    def __init__(self, router: str) -> None:
        self.endpoint = free_endpoint()
        self.delay_s = 0.0
        self._router = _address(router)
        self._is_cut = False
        self._sockets: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._listener = socket.create_server(_address(self.endpoint))
        self._begin(self._accept)

    def cut(self) -> None:
        """Pass nothing on; connections stay open, as where a cable is pulled."""
        self._is_cut = True

    def mend(self) -> None:
        """Pass on what comes from now on; what came meanwhile is lost."""
        self._is_cut = False

    def close(self) -> None:
        """End it."""
        for one in (self._listener, *self._sockets):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for one in (self._listener, *self._sockets):
            one.close()

    def _begin(self, run: object, *args: object) -> None:
        thread = threading.Thread(target=run, args=args, daemon=True)  # type: ignore[arg-type]
        thread.start()
        self._threads.append(thread)

    def _accept(self) -> None:
        while True:
            try:
                session, _ = self._listener.accept()
            except OSError:
                return
            self._sockets.append(session)
            if self._is_cut:
                continue
            try:
                router = socket.create_connection(self._router)
            except OSError:
                session.shutdown(socket.SHUT_RDWR)
                continue
            self._sockets.append(router)
            for source, to in ((session, router), (router, session)):
                under_way = SimpleQueue[tuple[float, bytes]]()
                self._begin(self._take, source, under_way, source is session)
                self._begin(self._send, under_way, to)

    def _take(
        self, source: socket.socket, under_way: SimpleQueue[tuple[float, bytes]], delays: bool
    ) -> None:
        data = b"-"
        while data:
            try:
                data = source.recv(CHUNK_BYTES)
            except OSError:
                data = b""
            under_way.put((time.monotonic() + (self.delay_s if delays else 0.0), data))

    def _send(self, under_way: SimpleQueue[tuple[float, bytes]], to: socket.socket) -> None:
        """Pass on what comes from one side when it is due."""
        while True:
            due, data = under_way.get()
            time.sleep(max(due - time.monotonic(), 0.0))
            if self._is_cut and data:
                continue
            with suppress(OSError):
                if data:
                    to.sendall(data)
                    continue
                to.shutdown(socket.SHUT_RDWR)
            if not data:
                return


def _address(endpoint: str) -> tuple[str, int]:
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    return host, int(port)
