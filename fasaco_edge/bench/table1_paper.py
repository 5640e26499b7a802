"""Table I of Carr and Wang 2022, and what is known of the grids it was made on.

Of the paper's three maps two can be made again from its authors' public code
(github.com/jynxmagic/FCPP-Survey, Apache-2.0): with a robot and a tool of 0.3 m
radius, the start at the map's origin, unknown pixels free, and a cell occupied
if one of its pixels is, their Spiral-STC and ZigZag give the table's 109, 487,
113 and 407 exactly. No setting tried gives the office's figures.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

VARIANTS = (
    *(f"velocity-{velocity}" for velocity in range(1, 9)),
    "rising",
    "falling",
    "spiral-stc",
    "zigzag",
)


@dataclass(frozen=True, slots=True)
class PaperFigures:
    """One line of Table I on one map: its n_r, and CPU time [s], 0 for about 0."""

    n_r: int
    cpu_s: float

    def document(self) -> dict[str, Any]:
        """Return this as JSON values."""
        return {"n_r": self.n_r, "cpu_s": self.cpu_s}


@dataclass(frozen=True, slots=True)
class PaperMap:
    """One map of Table I.

    Attributes:
        name: what the paper calls it.
        n_r, cpu_s: the table's columns, in the order of ``VARIANTS``.
        grid: name of the grid that its authors' code makes of it; "" where nobody knows.
        cells: how many cells that has.
        driven: revisits that the robot of the authors' Spiral-STC and ZigZag drives,
            start to start, by variant.
        optimum: revisits of a shortest walk, start to start; proven by branch and cut.
    """

    name: str
    n_r: tuple[int, ...]
    cpu_s: tuple[float, ...]
    grid: str = ""
    cells: int = 0
    driven: tuple[tuple[str, int], ...] = ()
    optimum: int | None = None

    def figures(self, variant: str) -> PaperFigures | None:
        """Return what the table says of a variant; None where it says nothing."""
        if variant not in VARIANTS:
            return None
        place = VARIANTS.index(variant)
        return PaperFigures(self.n_r[place], self.cpu_s[place])


TABLE_I = (
    PaperMap(
        "Office",
        (34, 30, 30, 34, 36, 30, 42, 36, 30, 30, 47, 45),
        (5.0, 5.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 0.0, 0.0),
    ),
    PaperMap(
        "Simulated map",
        (80, 80, 82, 70, 72, 72, 72, 72, 72, 70, 109, 113),
        (96.0, 76.0, 65.0, 56.0, 52.0, 50.0, 48.0, 48.0, 65.0, 65.0, 0.0, 0.0),
        grid="paper_simulated",
        cells=169,
        driven=(("spiral-stc", 80), ("zigzag", 84)),
        optimum=46,
    ),
    PaperMap(
        "Basement",
        (321, 347, 333, 305, 305, 293, 295, 307, 307, 299, 487, 407),
        (140.0, 126.0, 115.0, 108.0, 106.0, 102.0, 101.0, 100.0, 113.0, 113.0, 0.2, 0.0),
        grid="paper_basement",
        cells=520,
        driven=(("spiral-stc", 249), ("zigzag", 271)),
        optimum=53,
    ),
)


def paper_map(grid: str, cells: int) -> PaperMap | None:
    """Return the paper's map that a grid is, by its name and size; None if it is none."""
    return next((known for known in TABLE_I if (known.grid, known.cells) == (grid, cells)), None)
