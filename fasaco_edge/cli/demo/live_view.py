"""The live map of ``fasaco-edge watch`` as the view of a demo; of a fleet its table."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Self

from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli.console.streams import printed_by
from fasaco_edge.cli.console.terminal import err
from fasaco_edge.cli.demo.robots import FLEET
from fasaco_edge.client.events import ORDER
from fasaco_edge.client.feed import Feed
from fasaco_edge.client.phrases import steady_now
from fasaco_edge.watch.live import Watched, watch_on_screen
from fasaco_edge.watch.robot_view import RobotView
from fasaco_edge.watch.robot_watch import RobotWatch
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.keys import Keys


class LiveView:
    """Shows a demo on the alternate screen of the terminal, see ``view.DemoView``.

    What is said and printed meanwhile stands among the events of the page, and afterwards above
    the summary.

    Args:
        robots: names of the robots on the bus.
        endpoint: where their bus can be joined.
    """

    def __init__(self, robots: Sequence[str], endpoint: str) -> None:
        self._robots, self._bus = robots, BusSettings("client", (endpoint,))
        self._said: list[str] = []
        # A log may print on any thread.
        self._unseen: deque[str] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for text in self._said:
            err().print(text)

    def run(self, step: Callable[[float], bool]) -> None:
        """Show pages until ``step`` returns True.

        Raises:
            KeyboardInterrupt: q was typed, or a signal has come.
        """
        is_over = False
        with ExitStack() as stack:
            watched = self._watched(stack)

            def go_on() -> bool:
                nonlocal is_over
                is_over = step(0.0)
                while self._unseen:
                    watched.events.add(steady_now(), self._unseen.popleft(), ORDER)
                return not is_over

            stack.enter_context(printed_by(self.say))
            watch_on_screen(watched, sys.stderr, go_on)
        if not is_over:
            raise KeyboardInterrupt

    def show(self, robot: int, status: Status, elapsed_s: float) -> None:
        """Do nothing: what is watched comes by the bus."""

    def say(self, text: str) -> None:
        """Add lines to the events."""
        self._said += text.splitlines()
        self._unseen += text.splitlines()

    def _watched(self, stack: ExitStack) -> Watched:
        keys = Keys(self._robots[0])
        if len(self._robots) > 1:
            from fasaco_edge.cli.fleet_wing import fleet_on_bus

            watched, _ = stack.enter_context(fleet_on_bus(FLEET, keys, self._bus, err()))
            return watched
        feed = stack.enter_context(Feed(self._bus, keys))
        return RobotWatch(feed, RobotView(keys.robot), err())
