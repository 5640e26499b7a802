"""The server of a robot's live page: a thread makes messages from the robot's samples."""

from __future__ import annotations

from contextlib import suppress

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.queries import Reply
from fasaco_edge.client.feed import Feed
from fasaco_edge.client.phrases import steady_now
from fasaco_edge.errors import FasacoError
from fasaco_edge.serve.guard import Guard
from fasaco_edge.serve.served_view import ServedView
from fasaco_edge.serve.server import Server
from fasaco_edge.wire.topics import FLOOR, PHEROMONE, UNSWEPT

# Least period of messages to viewers, and longest wait for samples [s].
FRAME_S, IDLE_S = 0.1, 0.2
# Timeout of the query for a path [s].
PATH_S = 1.0


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
        """Return kind, number and content of the newest messages."""
        return [(kind, number, message) for kind, (number, message) in self._newest.items()]

    def ask(self, query: str, payload: bytes, timeout_s: float) -> list[Reply]:
        """Ask the daemon; blocks."""
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
            if self._view.lacks_path:
                self._ask_for_path(now)
            self._view.trouble = self._feed.trouble
            viewers = tuple(self._viewers)
            self._feed.want(FLOOR, bool(viewers))
            self._feed.want(UNSWEPT, any(viewer.wants_unswept for viewer in viewers))
            self._feed.want(PHEROMONE, any(viewer.wants_field for viewer in viewers))
            if viewers and (news := self._view.news(now)) and self._loop is not None:
                self._loop.call_soon_threadsafe(self._publish, news)
            self._ended.wait(max(FRAME_S - (steady_now() - now), 0.0))

    def _ask_for_path(self, now: float) -> None:
        """Query the path on which a paused robot continues, published before this server began."""
        self._view.lacks_path = False
        with suppress(FasacoError):
            for reply in self._feed.ask("path?before_stop", b"", PATH_S):
                if not reply.is_error:
                    self._view.take_path_before(
                        Sample("", reply.payload, reply.schema, reply.attachment), now
                    )

    def _publish(self, news: dict[str, str | bytes]) -> None:
        for kind, message in news.items():
            number, _ = self._newest.get(kind, (0, b""))
            self._newest[kind] = number + 1, message
        for viewer in self._viewers:
            viewer.news.set()
