"""Watch of a fleet: its feed from the bus, and the screen that shows its robots and events."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.bus.session import Bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli.ask import nobody_answers
from fasaco_edge.client import phrases
from fasaco_edge.client.feed import BusJoining
from fasaco_edge.client.phrases import clock, steady_now
from fasaco_edge.errors import FasacoError, NobodyAnswersError
from fasaco_edge.fleet.observer.queues import FleetInbox, FleetSubscriptions
from fasaco_edge.fleet.observer.survey import Survey
from fasaco_edge.fleet.watch.view import FleetRobot, FleetView, short
from fasaco_edge.text import one_line, percent
from fasaco_edge.watch.glyphs import FAINT, GlyphSet, ScreenBlocks, with_keys
from fasaco_edge.watch.live import Watched
from fasaco_edge.watch.page import Layout
from fasaco_edge.watch.status_table import LONGEST_BAR, state_colour
from fasaco_edge.wire.keys import VERSION, Keys
from fasaco_edge.wire.topics import STATUS

GONE_COLOUR, WAITING_COLOUR = "red", "yellow"
# Largest width of the table [characters].
WIDEST = 80


def robot_table(robots: Sequence[FleetRobot], width: int) -> Table:
    """Return a table of robots, one line each, for a width [characters]."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False, header_style=FAINT)
    table.width = min(width, WIDEST)
    table.add_column("robot", no_wrap=True, overflow="ellipsis", max_width=max(width // 3, 5))
    table.add_column("does", ratio=1, no_wrap=True, overflow="ellipsis")
    table.add_column("swept m2", justify="right", no_wrap=True)
    table.add_column("left m2", justify="right", no_wrap=True)
    for robot in robots:
        name = Text(robot.name, FAINT if robot.silent_s is not None else "")
        left = "-" if robot.left_cells is None else f"{robot.left_cells * robot.cell_m2:.1f}"
        table.add_row(name, _doing(robot), f"{robot.swept_cells * robot.cell_m2:.1f}", left)
    return table


def _doing(robot: FleetRobot) -> Text:
    if robot.silent_s is not None:
        return Text(f"gone for {phrases.age(robot.silent_s)}", GONE_COLOUR)
    colour = WAITING_COLOUR if robot.waits_for else state_colour(robot.state)
    doing = Text(robot.doing, colour)
    if robot.away and robot.away != robot.state:
        away = "not received by others" if robot.away == "gone" else robot.away
        doing.append(f" ({away})", WAITING_COLOUR)
    return doing


def total_rows(floor: Survey, unheard: Sequence[str], width: int, glyphs: GlyphSet) -> list[Text]:
    """Return lines with the totals over all robots, and the names of silent robots."""
    silent = [Text(f"no messages: {', '.join(unheard)}", GONE_COLOUR)] if unheard else []
    if floor.fraction is None:
        return silent
    swept_m2, area_m2 = floor.swept * floor.cell_m2, floor.area * floor.cell_m2
    share = Text(percent(floor.fraction), "bold")
    share.append(f" swept: {swept_m2:.1f} of {area_m2:.1f} m2", "not bold")
    lines = [share, glyphs.bar(floor.fraction, min(width, LONGEST_BAR))]
    if floor.twice_m2:
        lines.append(Text(f"{floor.twice_m2:.1f} m2 swept by two or more"))
    if floor.division:
        by = f" by {short(floor.by)}" if floor.by else ""
        lines.append(Text(f"division {floor.division}{by}", FAINT))
    return lines + silent


class FleetPage:
    """Drawing of a fleet's view as lines of text, with a cache for unchanged parts."""

    def __init__(self, console: Console) -> None:
        self._blocks = ScreenBlocks(console)

    def lines(self, view: FleetView, now: float, width: int, height: int, *keys: str) -> list[str]:
        """Return ``height`` lines, each ``width`` characters wide.

        Args:
            view: what to show.
            now: time since the epoch [s].
            width, height: size of the screen, each at least 1 [characters].
            keys: hints for the headline, if they fit.
        """
        blocks, robots, layout = self._blocks, view.robots(now), Layout.of(width, height)
        page = blocks.block(headline(view, robots, now, width, *keys), width, 1)
        # A fleet's page has no legend: the table gets its line.
        room = min(layout.lines + 1, height - 1)
        totals = total_rows(view.floor, view.unheard(now), width, blocks.glyphs)
        shown = Group(robot_table(robots, width), "", *totals) if robots else Text("")
        page += blocks.block(shown, width, room)
        if layout.entries:
            key = (view.events.count, width, layout)
            page += blocks.keep(
                "log", key, lambda: blocks.log(view.events, width, layout.entries, None)
            )
        return page + [" " * width] * (height - len(page))


def headline(
    view: FleetView, robots: Sequence[FleetRobot], now: float, width: int, *keys: str
) -> Text:
    """Return a line that sums up the fleet's activity, for a width [characters]."""
    line = Text().append(f" {short(view.fleet)} ", "bold reverse").append("  ")
    present = [robot for robot in robots if robot.silent_s is None]
    if view.trouble:
        line.append(f"waiting for the bus at {one_line(view.trouble)}", "red")
    elif not robots:
        line.append("waiting for robots of this fleet", "yellow")
        others = ", ".join(sorted(view.others))
        line.append(f"; on this bus: {others}" if others else "")
    elif not present:
        line.append("all robots are gone", "bold red")
    else:
        at_work = sum(robot.is_at_work for robot in robots)
        if all(robot.state == "done" for robot in present):
            line.append("DONE", "bold blue").append("  ")
        line.append(f"{at_work} of {len(robots)} robots at work", "bold green" if at_work else "")
        if view.floor.fraction is not None:
            line.append(f"  {percent(view.floor.fraction)} of cells")
    return with_keys(line, width, *keys, clock(now))


# Largest size of all waiting samples [bytes]; a robot gets at most a quarter of it.
CAPACITY_BYTES = 128_000_000


class FleetFeed(BusJoining):
    """The samples of the robots of a fleet; a context manager.

    The reader gets the fleet messages of all robots, and selects by ``attend`` the robots whose
    statuses it wants.

    Attributes:
        inbox: the samples that have arrived.
    """

    def __init__(self, settings: BusSettings, keys: Keys) -> None:
        super().__init__(settings)
        self._keys = keys
        self.inbox = FleetInbox(CAPACITY_BYTES, _stamped)
        self._subscriptions: FleetSubscriptions | None = None

    def attend(self, robots: Collection[str]) -> None:
        """Subscribe to the robots with these names; to be called often."""
        if (subscriptions := self._subscriptions) is not None:
            for robot in set(robots) - subscriptions.robots:
                subscriptions.subscribe(robot)

    def _listen(self, bus: Bus) -> None:
        subscriptions = FleetSubscriptions(bus, self._keys, (STATUS,), self.inbox.post)
        subscriptions.listen()
        self._subscriptions = subscriptions


def _stamped(topic: str, sample: Sample) -> Arrival:
    at_ns = int(1e9 * steady_now())
    return Arrival(topic, sample, at_ns, at_ns)


# Longest wait for the other robots after the first message [s]. A robot sends a message per second:
# within SENT_S [s] each robot has sent a message.
MOST_WAIT_S, SENT_S = 4.0, 1.3
# Period of printing JSON [s].
EVERY_S = 1.0


class FleetWatch(Watched):
    """The watch of a fleet, see ``live.Watched``."""

    most_wait_s = MOST_WAIT_S
    view: FleetView

    def __init__(self, feed: FleetFeed, view: FleetView, console: Console) -> None:
        self._feed, self.view = feed, view
        self._page = FleetPage(console)
        self._known_at = steady_now()
        self._printed_at = float("-inf")
        self._printed: dict[str, object] = {}

    def take(self, timeout_s: float) -> bool:
        view, feed = self.view, self._feed
        items = feed.inbox.take(timeout_s)
        was_known = self.is_known()
        for received in items:
            view.take(received)
            if view.members.get(received.robot) is None:
                # Invented names must not take all queues.
                feed.inbox.forget(received.robot)
        now = steady_now()
        if not was_known:
            self._known_at = now
        view.trouble = feed.trouble
        feed.attend(view.names())
        view.tick(now)
        return bool(items)

    def documents(self) -> list[dict[str, object]]:
        """Return the fleet's document if it is due and has changed, else none."""
        now = steady_now()
        if now - self._printed_at < EVERY_S or not self.is_known():
            return []
        document = self.document()
        if document == self._printed:
            return []
        self._printed_at, self._printed = now, document
        return [document]

    def document(self) -> dict[str, object]:
        """Return the fleet's document."""
        return self.view.document(steady_now())

    def line(self, now: float) -> str:
        """Return the robots' activities in a line."""
        view, robots = self.view, self.view.robots(now)
        if view.trouble:
            return f"waiting for the bus at {one_line(view.trouble)}"
        if not robots:
            return f"waiting for robots of fleet {one_line(view.fleet)}"
        fraction = view.floor.fraction
        share = "" if fraction is None else f"{percent(fraction)} of cells  "
        return f"{share}{', '.join(f'{robot.name}: {robot.doing}' for robot in robots)}"

    def page(self, now: float, width: int, height: int, *keys: str) -> list[str]:
        return self._page.lines(self.view, now, width, height, *keys)

    def is_known(self) -> bool:
        """Return whether a message of a robot has arrived."""
        return len(self.view.members) > 0

    def is_whole(self) -> bool:
        """Return whether all robots have had time for a message, and the survey includes them."""
        view = self.view
        is_complete = steady_now() - self._known_at > SENT_S
        return is_complete and view.floor.robots >= set(view.names())


@contextmanager
def fleet_on_bus(
    fleet: str, keys: Keys, bus: BusSettings, console: Console
) -> Iterator[tuple[FleetWatch, Callable[[], FasacoError]]]:
    """Yield the watch of a fleet, and a function that returns the error if no robot answers."""
    view = FleetView(fleet)
    with FleetFeed(bus, keys) as feed:
        yield FleetWatch(feed, view, console), lambda: _no_robot(keys, view)


def _no_robot(keys: Keys, view: FleetView) -> NobodyAnswersError:
    if not view.others:
        return nobody_answers(f"{keys.base}/{VERSION}/*", ())
    return NobodyAnswersError(
        f"no robot of a fleet {one_line(view.fleet)!r} answers",
        hint=f"there are robots of these fleets: {', '.join(sorted(view.others))}; "
        "`fleet: {name: ...}` in the configuration of a robot makes it a member",
    )
