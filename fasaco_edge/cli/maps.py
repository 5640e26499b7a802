"""``fasaco-edge maps``: the buildings that come with the package."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fasaco_edge.cli.console.arguments import add_command

if TYPE_CHECKING:
    from fasaco_edge.cli.console.arguments import Subparsers


def add_to(commands: Subparsers, common: argparse.ArgumentParser) -> None:
    """Add the command."""
    add_command(
        commands,
        common,
        "maps",
        run,
        about="list the maps that come with the package",
        description="List the maps that come with the package; plan, simulate and demo "
        "take them by name.",
    )


def run(args: argparse.Namespace) -> int:
    """Print name and purpose of each map."""
    from fasaco_edge.cli.console.terminal import figures, out
    from fasaco_edge.grid.map_files import builtin_maps

    out().print(figures(builtin_maps()))
    return 0
