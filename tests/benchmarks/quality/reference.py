"""What other planners reached on a grid, and what is proven of it, read from a file.

The file is a JSON object with an entry for each grid, by name::

    {"paper_simulated": {
        "cells": 169,
        "results": {"lkh_open": {"full": true, "steps": 186, "turns_90": 78, "turns_180": 3}},
        "proven_optimum": {"open_steps": 186, "closed_steps": 214},
        "bounds": {"hk_open": 186.0, "block_closed": 214}}}

All parts but ``results`` may be missing. Walks that are not ``full``, not complete, do not count.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fasaco_edge.errors import BadConfiguration

# The tour solver's walks: of the others, none is near to the best there is.
BEST_KNOWN_BY = {False: "lkh_open", True: "lkh_closed"}

# A bound of a linear programme may be above a whole number by as much and not mean it.
ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class OtherWalk:
    """A complete walk of another planner; ``returns_home`` if it ends where it began."""

    planner: str
    steps: int
    turns_90: int
    turns_180: int
    returns_home: bool

    def mission_s(self, turn_s: float) -> float:
        """Return its time [s], a second a step and ``turn_s`` a quarter-turn."""
        return self.steps + turn_s * (self.turns_90 + 2 * self.turns_180)


@dataclass(frozen=True, slots=True)
class Known:
    """What is known of walks on a grid that end anywhere, or of those that end at home.

    Attributes:
        walks: complete walks of other planners.
        optimum: steps of a shortest walk, proven; None if nobody knows.
        bound: no walk has fewer steps; 0 if nothing is known.
        best_steps: the best known: the optimum or the tour solver's walk.
    """

    walks: tuple[OtherWalk, ...] = ()
    optimum: int | None = None
    bound: int = 0
    best_steps: int | None = None

    def quickest(self, turn_s: float) -> OtherWalk | None:
        """Return the walk of the best of all planners by mission time; None without any."""
        return min(self.walks, key=lambda walk: walk.mission_s(turn_s), default=None)


@dataclass(frozen=True, slots=True)
class Reference:
    """What is known of a grid: its number of cells, open walks, and closed ones."""

    cells: int | None
    open: Known
    closed: Known

    def of(self, closed: bool) -> Known:
        """Return what is known of the one or the other."""
        return self.closed if closed else self.open


UNKNOWN = Reference(None, Known(), Known())


def read_references(file: Path | None) -> Mapping[str, Reference]:
    """Return what a file knows of each grid, by its name; nothing without a file.

    Raises:
        BadConfiguration: it cannot be read, or is not laid out as above.
    """
    if file is None:
        return {}
    try:
        grids = json.loads(file.read_text(encoding="utf-8"))
        return {name: _reference(grid) for name, grid in grids.items()}
    except OSError as error:
        raise BadConfiguration(f"cannot read {file}: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadConfiguration(
            f"{file}: expected results, bounds and optima of grids, got {error!r}"
        ) from error


def _reference(grid: dict[str, Any]) -> Reference:
    walks = tuple(_walk(name, walk) for name, walk in grid["results"].items() if walk["full"])
    return Reference(grid.get("cells"), _known(grid, walks, False), _known(grid, walks, True))


def _walk(name: str, walk: dict[str, Any]) -> OtherWalk:
    steps, quarter, half = (int(walk[figure]) for figure in ("steps", "turns_90", "turns_180"))
    return OtherWalk(name, steps, quarter, half, bool(walk.get("returns_home", False)))


def _known(grid: dict[str, Any], walks: tuple[OtherWalk, ...], closed: bool) -> Known:
    end = "closed" if closed else "open"
    optimum = grid.get("proven_optimum", {}).get(f"{end}_steps")
    bounds = [value for name, value in grid.get("bounds", {}).items() if name.endswith(f"_{end}")]
    solved = [walk.steps for walk in walks if walk.planner == BEST_KNOWN_BY[closed]]
    best = [*solved, *([] if optimum is None else [int(optimum)])]
    return Known(
        # A walk that comes home is one that may end anywhere, too.
        tuple(walk for walk in walks if walk.returns_home or not closed),
        None if optimum is None else int(optimum),
        max((math.ceil(float(bound) - ROUNDING) for bound in bounds), default=0),
        min(best, default=None),
    )
