"""A session that connects to the bus as soon as possible, and stays connected."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from typing import Self

from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable

RETRY_S = 0.5
# Timeout at the end for a host that does not answer.
END_S = 0.5


class Joining(ABC):
    """Joins the bus in a thread, and listens on it; a context manager.

    Attributes:
        trouble: why the bus cannot be joined yet; "" once it is.
    """

    def __init__(self, settings: BusSettings) -> None:
        self.trouble = ""
        self._settings = settings
        self._ended = threading.Event()
        self._bus: Bus | None = None
        self._lock = threading.Lock()
        # In a thread: a host that does not answer would block the caller.
        self._joining = threading.Thread(target=self._join, name="join-bus", daemon=True)

    def __enter__(self) -> Self:
        self._joining.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        # An interpreter that ends while a thread returns from Zenoh aborts.
        self._joining.join(END_S)
        with self._lock:
            if self._bus is not None:
                self._bus.close()

    @abstractmethod
    def _listen(self, bus: Bus) -> None:
        """Declare the subscriptions; on the thread that joined, with the lock held."""

    def _join(self) -> None:
        while not self._ended.is_set():
            try:
                bus = open_bus(self._settings)
            except BusUnavailable as error:
                self.trouble = f"{', '.join(self._settings.connect)}: {error}"
                self._ended.wait(RETRY_S)
                continue
            with self._lock:
                if self._ended.is_set():
                    bus.close()
                    return
                self._bus = bus
                self._listen(bus)
                self.trouble = ""
            return
