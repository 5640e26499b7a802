"""``fasaco-edge watch --fleet``: the connection of the watch to a fleet on the bus."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console

from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli.ask import nobody_answers
from fasaco_edge.errors import FasacoError, NobodyAnswersError
from fasaco_edge.fleet.watch.page import FleetFeed, FleetWatch
from fasaco_edge.fleet.watch.view import FleetView
from fasaco_edge.text import one_line
from fasaco_edge.wire.keys import VERSION, Keys


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
        "`fleet: {name: ...}` in its configuration makes a robot one of a fleet",
    )
