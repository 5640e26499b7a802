"""The option ``--passes`` of ``plan`` and ``mission start``."""

from __future__ import annotations

import argparse

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.passes import Pass, read_passes

WORDS = (
    "auto (lanes as they are cheapest, or along the cells' rows if a cross follows), cross (lanes "
    "across those of the pass before), 30deg (lanes at an angle to the map's x axis, "
    "counter-clockwise), edge (only the cells along walls and furniture), rest (the others, after "
    "an edge) or rest:cross; with %%30 lanes overlap by 30 percent of the tool's width, in place "
    "of the robot's; with @0.15 behind it at that speed, at most the robot's [m/s]"
)


def add_passes(group: argparse._ActionsContainer, help_text: str) -> None:
    """Add the option: its value is a tuple of passes, None if it is not given."""
    group.add_argument("--passes", type=_passes, metavar="N|PASS,...", help=help_text)


def _passes(text: str) -> tuple[Pass, ...]:
    try:
        return read_passes(text)
    except BadConfiguration as error:
        raise argparse.ArgumentTypeError(str(error)) from None
