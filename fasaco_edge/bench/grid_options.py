"""Which grids to measure on: options that several benchmarks take."""

from __future__ import annotations

import argparse


def add_grid_options(parser: argparse.ArgumentParser, default_maps: tuple[str, ...]) -> None:
    """Declare ``--grids`` and ``--maps``."""
    parser.add_argument(
        "--grids",
        nargs="+",
        default=[],
        metavar="FILE.npy",
        help="coverage grids (bool, True = free); FILE.json beside one may name "
        'the start: {"start": [row, col]}',
    )
    parser.add_argument(
        "--maps",
        nargs="+",
        default=[],
        metavar="MAP",
        help="map_server YAMLs or names from `maps`, in cells of 0.3 m for a robot of 0.18 m "
        f"radius (default, without --grids: {' '.join(default_maps)})",
    )


def grid_names(args: argparse.Namespace, default_maps: tuple[str, ...]) -> tuple[str, ...]:
    """Return the grids and maps asked for, else the default ones."""
    return (*args.grids, *args.maps) or default_maps
