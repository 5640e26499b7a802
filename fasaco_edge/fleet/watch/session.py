"""A fleet that is watched: its feed, its view, and the page that shows it."""

from __future__ import annotations

from rich.console import Console

from fasaco_edge.client import phrases
from fasaco_edge.client.events import EventLog
from fasaco_edge.fleet.watch.feed import FleetFeed
from fasaco_edge.fleet.watch.page import FleetPage
from fasaco_edge.fleet.watch.view import FleetView
from fasaco_edge.text import one_line

# Time to wait for the other robots after the first message [s]. Each robot sends its place and its
# swept cells once a second.
REST_S, TOLD_S = 4.0, 1.3
# Period of counting rates and of printing JSON [s].
EVERY_S = 1.0


class FleetWatch:
    """The watch of a fleet, see ``live.Watched``."""

    rest_s = REST_S

    def __init__(self, feed: FleetFeed, view: FleetView, console: Console) -> None:
        self._feed, self._view = feed, view
        self._page = FleetPage(console)
        self._known_at = self._counted_at = phrases.steady_now()
        self._printed_at = float("-inf")
        self._printed: dict[str, object] = {}

    @property
    def events(self) -> EventLog:
        """What happened."""
        return self._view.events

    @property
    def trouble(self) -> str:
        """Why the bus cannot be reached; "" if it can."""
        return self._view.trouble

    def take(self, timeout_s: float) -> bool:
        """Take in arrivals; wait up to ``timeout_s`` [s] for one; return whether one came."""
        view, feed = self._view, self._feed
        items = feed.take(timeout_s)
        was_known = self.is_known()
        for heard in items:
            view.take(heard)
            if view.members.get(heard.robot) is None:
                # A queue for each of any number of names would leave no room for real robots.
                feed.forget(heard.robot)
        now = phrases.steady_now()
        if not was_known:
            self._known_at = now
        view.trouble = feed.trouble
        feed.attend(view.names())
        self._count(now)
        view.tick(now)
        return bool(items)

    def documents(self) -> list[dict[str, object]]:
        """Return the fleet, once a second if it has changed."""
        now = phrases.steady_now()
        if now - self._printed_at < EVERY_S or not self.is_known():
            return []
        document = self.document()
        if document == self._printed:
            return []
        self._printed_at, self._printed = now, document
        return [document]

    def document(self) -> dict[str, object]:
        """Return the fleet and its robots."""
        return self._view.document(phrases.steady_now())

    def line(self, now: float) -> str:
        """Return the robots' activities in a line."""
        view, robots = self._view, self._view.robots(now)
        if view.trouble:
            return f"waiting for the bus at {one_line(view.trouble)}"
        if not robots:
            return f"waiting for robots of fleet {one_line(view.fleet)}"
        fraction = view.floor.fraction
        share = "" if fraction is None else f"{phrases.percent(fraction)} of cells  "
        return f"{share}{', '.join(f'{robot.name}: {robot.doing}' for robot in robots)}"

    def page(self, now: float, width: int, height: int) -> list[str]:
        """Return a page of lines."""
        return self._page.lines(self._view, now, width, height)

    def press(self, keys: str) -> bool:
        """Handle typed keys: none has an effect here."""
        return False

    def is_known(self) -> bool:
        """Return whether a message of a robot has arrived."""
        return len(self._view.members) > 0

    def is_whole(self) -> bool:
        """Return whether all robots have had time for a message."""
        view = self._view
        is_told = phrases.steady_now() - self._known_at > TOLD_S
        return is_told and view.floor.robots >= set(view.names())

    def _count(self, now: float) -> None:
        passed_s = now - self._counted_at
        if passed_s < EVERY_S:
            return
        self._counted_at = now
        for name in self._view.names():
            self._view.note_rate(name, 1e-3 * self._feed.traffic(name).bytes / passed_s)
