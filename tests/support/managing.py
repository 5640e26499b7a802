"""A service manager as systemd is one: it listens to what a daemon tells it."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import suppress
from pathlib import Path


class Manager:
    """Listens on $NOTIFY_SOCKET, all the time."""

    def __init__(self, folder: Path) -> None:
        self.said: list[str] = []
        self.address = str(folder / "notify")
        self._read = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(self.address)
        self._socket.settimeout(0.05)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def count(self, word: str, seconds: float) -> int:
        """Return how often ``word`` is said within so many seconds from now."""
        before = len(self.said)
        time.sleep(seconds)
        return self.said[before:].count(word)

    def wait(self, word: str, seconds: float = 30.0) -> str:
        """Return what is said next that begins with ``word``."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            for number, text in enumerate(self.said[self._read :], self._read):
                if text.startswith(word):
                    self._read = number + 1
                    return text
            time.sleep(0.02)
        raise AssertionError(f"{word} was not said, but {self.said[self._read :]}")

    def close(self) -> None:
        self._closed.set()
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        while not self._closed.is_set():
            with suppress(TimeoutError):
                self.said.append(self._socket.recv(65536).decode())
