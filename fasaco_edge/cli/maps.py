"""``fasaco-edge maps``: the buildings that come with the package."""

from __future__ import annotations

import argparse

from fasaco_edge.cli.console.arguments import Subcommand
from fasaco_edge.cli.console.terminal import figures, out
from fasaco_edge.grid.map_files import builtin_maps


def run(args: argparse.Namespace) -> int:
    """Print name and purpose of each map."""
    out().print(figures(builtin_maps()))
    return 0


COMMAND = Subcommand(
    description="List the maps that come with the package; plan, simulate and demo "
    "take them by name.",
    run=run,
)
