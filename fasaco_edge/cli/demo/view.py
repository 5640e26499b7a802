"""The view of a demo: the screen of ``watch`` if the terminal can show it, else lines of text."""

from __future__ import annotations

import os
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli.console.streams import printed_by
from fasaco_edge.cli.console.terminal import can_draw, err, say
from fasaco_edge.cli.demo.robots import FLEET
from fasaco_edge.client import phrases
from fasaco_edge.client.phrases import ORDER
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys

if TYPE_CHECKING:
    from fasaco_edge.watch.live import Watched

LINE_EVERY_S = 5.0
WAIT_S = 0.25
# Least size of a terminal in which a map is readable [characters].
LEAST_COLUMNS, LEAST_LINES = 60, 20


def demo_view(robots: Sequence[str], endpoint: str) -> LinesView | LiveView:
    """Return the view that suits the terminal.

    Args:
        robots: names of the robots.
        endpoint: endpoint of their bus.
    """
    if _is_screen():
        try:
            from fasaco_edge.watch import live  # noqa: F401 - the folder may be missing
        except ModuleNotFoundError as error:
            if not (error.name or "").startswith("fasaco_edge.watch"):
                raise
        else:
            return LiveView(robots, endpoint)
    return LinesView(robots)


def _is_screen() -> bool:
    """Return whether standard error is a terminal that can show a map, in the foreground."""
    if not can_draw(err()):
        return False
    terminal = err().file.fileno()
    size = os.get_terminal_size(terminal)
    if size.columns < LEAST_COLUMNS or size.lines < LEAST_LINES:
        return False
    try:
        # A process in the background is stopped when it changes the terminal's mode.
        return os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:  # it is not this session's terminal
        return False


class LinesView:
    """Prints the state of each robot every few seconds."""

    def __init__(self, robots: Sequence[str]) -> None:
        self._names = robots
        self._printed_at = [0.0] * len(robots)

    def run(self, step: Callable[[float], bool]) -> bool:
        """Call ``step`` with a timeout [s] until it returns True."""
        while not step(WAIT_S):
            pass
        return True

    def show(self, robot: int, status: Status, elapsed_s: float) -> None:
        """Print a line, unless the robot's last line is too recent."""
        now = time.monotonic()
        if now - self._printed_at[robot] < LINE_EVERY_S:
            return
        self._printed_at[robot] = now
        name = f"{self._names[robot]}  " if len(self._names) > 1 else ""
        say(err(), name + phrases.figures(status), f"{elapsed_s:6.1f} s  ", " " * 10)


class LiveView:
    """Shows a demo on the alternate screen of the terminal.

    Text printed meanwhile is shown among the events, and again above the summary.
    """

    def __init__(self, robots: Sequence[str], endpoint: str) -> None:
        self._robots, self._bus = robots, BusSettings("client", (endpoint,))
        self._printed: list[str] = []
        # A log may print on any thread.
        self._unseen: deque[str] = deque()

    def run(self, step: Callable[[float], bool]) -> bool:
        """Show the demo until ``step`` returns True or the user quits; return whether it is over.

        Raises:
            KeyboardInterrupt: a signal ended the view.
        """
        from fasaco_edge.watch.live import watch_on_screen

        is_over = False
        with ExitStack() as stack:
            watched = self._watched(stack)

            def go_on() -> bool:
                nonlocal is_over
                is_over = step(0.0)
                while self._unseen:
                    watched.view.events.add(phrases.steady_now(), self._unseen.popleft(), ORDER)
                return not is_over

            stack.callback(self._print_again)
            stack.enter_context(printed_by(self._keep))
            quits = watch_on_screen(watched, sys.stderr, go_on)
        if not (is_over or quits):
            raise KeyboardInterrupt
        return is_over

    def show(self, robot: int, status: Status, elapsed_s: float) -> None:
        """Do nothing: the view receives statuses from the bus itself."""

    def _print_again(self) -> None:
        for text in self._printed:
            err().print(text)

    def _keep(self, text: str) -> None:
        self._printed += text.splitlines()
        self._unseen += text.splitlines()

    def _watched(self, stack: ExitStack) -> Watched:
        keys = Keys(self._robots[0])
        if len(self._robots) > 1:
            from fasaco_edge.cli.fleet_wing import fleet_on_bus

            watched, _ = stack.enter_context(fleet_on_bus(FLEET, keys, self._bus, err()))
            return watched
        from fasaco_edge.client.feed import Feed
        from fasaco_edge.watch.page import RobotWatch
        from fasaco_edge.watch.picture import RobotView

        feed = stack.enter_context(Feed(self._bus, keys))
        return RobotWatch(feed, RobotView(keys.robot), err())
