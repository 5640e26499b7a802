"""Drawing area in map coordinates: its view, its scale, and operations to draw on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw, ImageFont

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.palette import Colour
from fasaco_edge.grid.geometry import Bounds, GridGeometry, Point, Window
from fasaco_edge.grid.lattice import BLOCKED, COVERABLE, UNKNOWN, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid, known_bounds

MAX_WIDTH, MAX_HEIGHT = 1760, 1600
MAX_CELL = 36
MARGIN_CELLS = 1.0

# Samples per pixel and axis of pictures of up to FINE_UP_TO pixels, and of larger ones, to save
# memory.
FINE, COARSE = 3, 2
FINE_UP_TO = 1_200_000


@dataclass(frozen=True, slots=True)
class PlotView:
    """A rectangle of the map frame as a rectangle of pixels, y upwards.

    Attributes:
        left, top: map coordinates of the upper left corner [m].
        scale: pixels per metre of the finished picture.
        width, height: size of the finished picture [px].
        oversampling: samples per pixel and axis while it is drawn.
    """

    left: float
    top: float
    scale: float
    width: int
    height: int
    oversampling: int

    @classmethod
    def over(
        cls, bounds: Bounds, cell_m: float, widest: int = MAX_WIDTH, highest: int = MAX_HEIGHT
    ) -> PlotView:
        """Return a view of ``bounds`` (x0, y0, x1, y1) [m], with a margin around.

        Args:
            bounds: the area to show.
            cell_m: edge of a cell [m], the width of the margin.
            widest, highest: largest size of the picture [px].
        """
        margin = MARGIN_CELLS * cell_m
        x0, y0, x1, y1 = bounds
        wide, high = x1 - x0 + 2 * margin, y1 - y0 + 2 * margin
        scale = min(MAX_CELL / cell_m, widest / wide, highest / high)
        width, height = max(round(wide * scale), 1), max(round(high * scale), 1)
        oversampling = FINE if width * height <= FINE_UP_TO else COARSE
        return cls(x0 - margin, y1 + margin, scale, width, height, oversampling)

    @property
    def samples_per_metre(self) -> float:
        """Scale of the oversampled picture."""
        return self.scale * self.oversampling

    def samples(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (x, y) [m] as places in the oversampled picture [px], both (n, 2)."""
        corner, up = np.array([self.left, self.top]), np.array([1.0, -1.0])
        samples: NDArray[np.float64] = (points - corner) * up * self.samples_per_metre
        return samples


def bounds_of(
    grid: OccupancyGrid | None, lattice: CoverageLattice, points: NDArray[np.float64]
) -> Bounds:
    """Return the bounds [m] of the known part of the map, or else of the lattice, and of points."""
    if grid is not None:
        known = known_bounds(grid) or grid.geometry.bounds()
    else:
        box = Window.of(lattice.states != UNKNOWN) or Window(0, 0, *lattice.states.shape)
        here = box.moved(lattice.window.row0, lattice.window.col0)
        x0, y0, x1, y1 = (
            lattice.cell_m * at for at in (here.col0, here.row0, here.col1, here.row1)
        )
        known = x0, y0, x1, y1
    if not len(points):
        return known
    corners = np.concatenate([np.reshape(known, (2, 2)), points])
    (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return x0, y0, x1, y1


@dataclass(frozen=True, slots=True, eq=False)
class MapLayer:
    """Marked pixels of any raster, bool (rows, cols), and their placement."""

    geometry: GridGeometry
    mask: NDArray[np.bool_]

    @property
    def area_m2(self) -> float:
        """Area of the marked pixels [m2]."""
        return int(np.count_nonzero(self.mask)) * self.geometry.resolution**2


# Least size of a cell for lines between cells [px].
RULED_CELL_PX = 14
HATCH_PX = 7
LINE_PX, OUTLINE_PX = 1.2, 2.5
MARK_RADIUS_PX = 8.0
NAME_PX, RIM_PX = 16, 2


class Plot:
    """A picture under construction, drawn in layers from the bottom up."""

    def __init__(self, view: PlotView) -> None:
        self.view = view
        self._size = (view.width * view.oversampling, view.height * view.oversampling)
        self._image = Image.new("RGB", self._size, palette.UNKNOWN)
        self._draw = ImageDraw.Draw(self._image)

    def finished(self) -> Image.Image:
        """Return the picture, RGB, (view.width, view.height)."""
        return self._image.reduce(self.view.oversampling)

    def ground(self, source: OccupancyGrid | CoverageLattice) -> None:
        """Draw free, occupied and unknown floor: a map's pixels, or a lattice's cells."""
        if isinstance(source, CoverageLattice):
            table = np.empty((3, 3), np.uint8)
            table[UNKNOWN], table[BLOCKED] = palette.UNKNOWN, palette.OCCUPIED
            table[COVERABLE] = palette.FREE
            image = self._spread(source, table[source.states], palette.UNKNOWN)
        else:
            shades = np.rint(np.linspace(palette.FREE, palette.OCCUPIED, 101))
            # The last entry is for -1, unknown.
            table = np.vstack([shades, palette.UNKNOWN]).astype(np.uint8)
            image = self._placed(source.geometry, table[source.cells], palette.UNKNOWN)
        self._image, self._draw = image, ImageDraw.Draw(image)

    def _placed(
        self, geometry: GridGeometry, values: NDArray[np.uint8], outside: Colour | int
    ) -> Image.Image:
        """Return a map's pixels, uint8 (rows, cols) or (rows, cols, 3), as an image of the view."""
        step = 1 / self.view.samples_per_metre
        left, top = self.view.left, self.view.top
        col, row = geometry.to_pixels(left, top)
        right, down = geometry.to_pixels(left + step, top), geometry.to_pixels(left, top - step)
        return Image.fromarray(values).transform(
            self._size,
            Image.Transform.AFFINE,
            (right[0] - col, down[0] - col, col, right[1] - row, down[1] - row, row),
            Image.Resampling.NEAREST,
            fillcolor=outside,
        )

    def paint(self, layer: MapLayer, colour: Colour) -> None:
        """Paint the marked pixels of a layer."""
        placed = self._placed(layer.geometry, layer.mask.astype(np.uint8) * 255, 0)
        self._image.paste(colour, mask=placed)

    def tint(self, lattice: CoverageLattice, colours: NDArray[np.uint8]) -> None:
        """Tint cells with colours, uint8 (rows, cols, 3); white leaves a cell unchanged."""
        layer = self._spread(lattice, colours, palette.PAPER)
        if lattice.cell_m * self.view.scale >= RULED_CELL_PX:
            self._rule(layer, lattice.cell_m)
        # Multiplied, so that dark parts of the map stay dark.
        self._image = ImageChops.multiply(self._image, layer)
        self._draw = ImageDraw.Draw(self._image)

    def hatch(self, lattice: CoverageLattice, where: NDArray[np.bool_], colour: Colour) -> None:
        """Hatch the cells ``where``, bool (rows, cols)."""
        if not where.any():
            return
        spread = self._spread(lattice, where.astype(np.uint8) * 255, 0)
        width, height = self._size
        period = HATCH_PX * self.view.oversampling
        stripes = np.add.outer(np.arange(height), np.arange(width)) % period < period // 3
        mask = np.asarray(spread) * stripes
        self._image.paste(colour, mask=Image.fromarray(mask))

    def track(self, starts: NDArray[np.float64], ends: NDArray[np.float64], width_m: float) -> None:
        """Draw segments (n, 2) to (n, 2) [m], coloured from the first to the last."""
        colours = palette.gradient(np.linspace(0.0, 1.0, len(starts))).tolist()
        thinnest = LINE_PX * self.view.oversampling
        # With fractions or even widths, the round ends would stand out from the line.
        radius = round(max(width_m * self.view.samples_per_metre, thinnest)) // 2
        width = 2 * radius + 1
        places = np.hstack([self.view.samples(starts), self.view.samples(ends)])
        lines = np.rint(places).astype(np.int64).tolist()
        for (x0, y0, x1, y1), colour in zip(lines, map(tuple, colours), strict=True):
            self._draw.line((x0, y0, x1, y1), colour, width)
            self._draw.ellipse((x1 - radius, y1 - radius, x1 + radius, y1 + radius), colour)

    def line(self, points: NDArray[np.float64], colour: Colour, width_px: float) -> None:
        """Draw a line, points (n, 2) [m], ``width_px`` wide on the finished picture."""
        if len(points) > 1:
            places = [*map(tuple, self.view.samples(points).tolist())]
            self._draw.line(places, colour, round(width_px * self.view.oversampling), "curve")

    def outline(self, polygon: Sequence[Point], colour: Colour) -> None:
        """Draw the border of a polygon, its corners (x, y) [m]."""
        self.line(np.array((*polygon, polygon[0]), np.float64), colour, OUTLINE_PX)

    def arrow(self, at: NDArray[np.float64], along: NDArray[np.float64], size_m: float) -> None:
        """Draw an arrow head with its middle at (x, y) [m], in the direction of a unit vector."""
        across = np.array([-along[1], along[0]])
        for grown, colour in ((1.6, palette.PAPER), (1.0, palette.INK)):
            # The middle is the centre of the triangle's incircle: so all rims are of one width.
            front = along * size_m * (grown * 2 / 3)
            back = along * size_m * (-grown / 3)
            side = across * size_m * (grown * 0.58)
            corners = at + np.array([front, back + side, back - side])
            self._draw.polygon([*map(tuple, self.view.samples(corners).tolist())], colour)

    def start_mark(self, point: NDArray[np.float64]) -> None:
        """Mark the start, (x, y) [m], with a disc."""
        for radius, colour in ((1.35, palette.PAPER), (1.0, palette.START), (0.35, palette.PAPER)):
            self._draw.ellipse(self._box(point, radius), colour)

    def end_mark(self, point: NDArray[np.float64]) -> None:
        """Mark the end, (x, y) [m], with a square."""
        for radius, colour in ((1.25, palette.PAPER), (0.9, palette.END), (0.3, palette.PAPER)):
            self._draw.rectangle(self._box(point, radius), colour)

    def text(self, words: str, point: Point) -> None:
        """Write a few words, centred on a point (x, y) [m]."""
        x, y = self.view.samples(np.array([point]))[0].tolist()
        size = NAME_PX * self.view.oversampling
        rim = RIM_PX * self.view.oversampling
        font = ImageFont.load_default(size)
        self._draw.text(
            (x, y), words, palette.INK, font, "mm", stroke_width=rim, stroke_fill=palette.PAPER
        )

    def _box(self, point: NDArray[np.float64], radius: float) -> tuple[float, float, float, float]:
        x, y = self.view.samples(point[None])[0].tolist()
        half = radius * MARK_RADIUS_PX * self.view.oversampling
        return x - half, y - half, x + half, y + half

    def _spread(
        self, lattice: CoverageLattice, values: NDArray[np.uint8], outside: Colour | int
    ) -> Image.Image:
        geometry = GridGeometry.of_cells(lattice.window, lattice.cell_m)
        return self._placed(geometry, values, outside)

    def _rule(self, layer: Image.Image, cell_m: float) -> None:
        view, draw, (width, height) = self.view, ImageDraw.Draw(layer), self._size
        step = view.samples_per_metre * cell_m
        x = (math.ceil(view.left / cell_m) * cell_m - view.left) * view.samples_per_metre
        y = (view.top - math.floor(view.top / cell_m) * cell_m) * view.samples_per_metre
        for place in np.arange(x, width, step).tolist():
            draw.line((place, 0, place, height), palette.PAPER, view.oversampling)
        for place in np.arange(y, height, step).tolist():
            draw.line((0, place, width, place), palette.PAPER, view.oversampling)
