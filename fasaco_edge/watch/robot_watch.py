"""Watch of one robot: its feed, its view, and the page that shows it."""

from __future__ import annotations

from contextlib import suppress

from rich.console import Console

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client import phrases
from fasaco_edge.client.events import EventLog
from fasaco_edge.client.feed import Feed
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.text import one_line, percent
from fasaco_edge.watch.page import Page
from fasaco_edge.watch.robot_view import RobotView
from fasaco_edge.wire.documents.json_text import decode_json

# Longest wait for map, coverage and path after a status [s].
REST_S = 1.0


class RobotWatch:
    """One watched robot, see ``live.Watched``."""

    rest_s = REST_S

    def __init__(self, feed: Feed, view: RobotView, console: Console) -> None:
        self._feed, self._view = feed, view
        self._page = Page(console)
        self._statuses: list[bytes] = []

    @property
    def events(self) -> EventLog:
        """The latest events."""
        return self._view.events

    @property
    def trouble(self) -> str:
        """Why the bus cannot be reached; "" if it can."""
        return self._view.trouble

    def take(self, timeout_s: float) -> bool:
        """Take in arrivals; wait up to ``timeout_s`` [s] for one; return whether one came."""
        items = self._feed.take(timeout_s)
        now = phrases.steady_now()
        for topic, item in items:
            self._view.take(topic, item, now)
        self._statuses = [
            item.payload for topic, item in items if topic == "status" and isinstance(item, Sample)
        ]
        self._view.trouble = self._feed.trouble
        return bool(items)

    def documents(self) -> list[dict[str, object]]:
        """Return the statuses that the last ``take`` received."""
        found = []
        for payload in self._statuses:
            # The view reports unreadable statuses.
            with suppress(MalformedMessage):
                found.append(decode_json(payload))
        return found

    def document(self) -> dict[str, object]:
        """Return the newest status."""
        return decode_json(self._view.document)

    def line(self, now: float) -> str:
        """Return the state in a line."""
        view, status = self._view, self._view.status
        if view.trouble:
            return f"waiting for the bus at {one_line(view.trouble)}"
        if view.gone_since is not None:
            return "waiting for the daemon to return"
        if not view.is_here:
            return f"waiting for a daemon of robot {view.robot}"
        if status is None:
            return "no status from the daemon yet"
        if view.silent_s(now):
            return "the daemon is silent"
        fraction = status.coverage.fraction if status.coverage else 0.0
        return f"{percent(fraction)} of cells  {phrases.figures(status)}"

    def page(self, now: float, width: int, height: int) -> list[str]:
        """Return a page of lines."""
        return self._page.lines(self._view, now, width, height)

    def is_known(self) -> bool:
        """Return whether a status of the robot's daemon has arrived."""
        return self._view.status is not None and self._view.is_here

    def is_whole(self) -> bool:
        """Return whether map, coverage and path are known."""
        view = self._view
        return view.map is not None and view.coverage is not None and view.walk.revision > 0
