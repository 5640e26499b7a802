"""The option ``--passes`` of ``plan`` and ``mission start``."""

from __future__ import annotations

import argparse

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.planners.passes import Pass, read_passes

# Help text on the option's value: it continues a text that ends with "the number of passes, or".
WORDS = (
    "one item for each pass: auto (the cheapest lanes; before a cross pass, lanes along the rows "
    "of cells), cross (lanes across those of the pass before), 30deg (lanes at this angle to the "
    "map's x axis, counter-clockwise), edge (only the cells along walls and furniture), rest (the "
    "cells that an edge pass leaves) or rest:cross. Append %%30 for an overlap of 30 %% of the "
    "tool's width, then @0.15 for a speed of 0.15 m/s, at most the robot's"
)


def add_passes(group: argparse._ActionsContainer, help_text: str) -> None:
    """Add the option: its value is a tuple of passes, None if it is not given."""
    group.add_argument("--passes", type=_passes, metavar="N|PASS,...", help=help_text)


def _passes(text: str) -> tuple[Pass, ...]:
    try:
        return read_passes(text)
    except BadConfiguration as error:
        raise argparse.ArgumentTypeError(str(error)) from None
