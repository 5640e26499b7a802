"""Slow, obvious twins of the compiled kernels: dicts, sets, lists and plain arithmetic.

Written from the paper and from what the kernels' docstrings promise. Where two
ways of adding up would differ in the last bit, the order is the documented one,
so that a twin and its kernel agree bit for bit.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.grid.lattice import TOUCH_TOLERANCE_PX, Footprint
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.paper.colony import ColonyConfig

UNKNOWN, BLOCKED, COVERABLE = 0, 1, 2

Cell = tuple[int, int]
Point = tuple[float, float]
Move = tuple[Cell, Cell]

# Counter-clockwise from east; row 0 is the southernmost.
EAST, NORTH, WEST, SOUTH = (0, 1), (1, 0), (0, -1), (-1, 0)
DIRECTIONS = (EAST, NORTH, WEST, SOUTH)


class Xoshiro128PlusPlus:
    """Blackman and Vigna's generator, as they publish it, on Python's integers."""

    def __init__(self, state: list[int]) -> None:
        self.s = state

    def word(self) -> int:
        """Return the next 32 bits."""
        s = self.s
        result = (_rotated((s[0] + s[3]) % 2**32, 7) + s[0]) % 2**32
        t = (s[1] << 9) % 2**32
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = _rotated(s[3], 11)
        return result

    def uniform(self) -> float:
        """Return a number in [0, 1)."""
        return self.word() / 2**32


def _rotated(word: int, by: int) -> int:
    return (word << by) % 2**32 | word >> (32 - by)


def neighbours(steps: NDArray[np.uint8]) -> dict[Cell, dict[Cell, Cell]]:
    """Return for each cell the legal steps: direction -> the cell it leads to."""
    return _neighbours(tuple(map(tuple, steps.tolist())))


# Asked for with each move of a search, on the same ground.
@functools.lru_cache(maxsize=8)
def _neighbours(steps: tuple[tuple[int, ...], ...]) -> dict[Cell, dict[Cell, Cell]]:
    return {
        (row, col): {
            (up, right): (row + up, col + right)
            for bit, (up, right) in enumerate(DIRECTIONS)
            if mask & 2**bit
        }
        for row, masks in enumerate(steps)
        for col, mask in enumerate(masks)
    }


def distances(steps: NDArray[np.uint8], start: Cell) -> dict[Cell, int]:
    """Return the number of steps to every cell that can be reached."""
    around = neighbours(steps)
    found, ring = {start: 0}, [start]
    while ring:
        ring = list({after for cell in ring for after in around[cell].values()} - found.keys())
        found.update(dict.fromkeys(ring, 1 + max(found.values())))
    return found


@dataclass
class Colony:
    """Equations (4) to (8) on a dictionary of moves."""

    around: dict[Cell, dict[Cell, Cell]]
    to_cover: set[Cell]
    config: ColonyConfig
    end: Cell | None
    trail: dict[Move, float]
    cost: CoverageCost = field(default_factory=CoverageCost)

    def walk(self, start: Cell, velocity: int, random: Xoshiro128PlusPlus) -> list[Cell]:
        """Let one ant walk until every cell is covered (Algorithm 1, lines 3 to 5)."""
        uncovered = self.to_cover - {start}
        walk, heading = [start], EAST
        while uncovered:
            direction = self.choose(walk[-1], heading, velocity, uncovered, random)
            if direction is None:
                # A dead end is left by the shortest walk to the nearest uncovered cell.
                way = self.shortest(walk[-1], uncovered)
                heading = _difference(way[-2], way[-1])
                walk += way[1:]
            else:
                heading = direction
                # Velocity v: straight on for up to v cells, as long as they are uncovered.
                for _ in range(velocity):
                    ahead = self.around[walk[-1]].get(direction)
                    if ahead not in uncovered:
                        break
                    walk.append(ahead)
                    uncovered.discard(ahead)
            uncovered.discard(walk[-1])
        return walk + self.way_to_end(walk[-1])

    def way_to_end(self, here: Cell) -> list[Cell]:
        """Return the steps that are left when all is covered."""
        return [] if self.end in (None, here) else self.shortest(here, {self.end})[1:]

    def choose(
        self,
        here: Cell,
        heading: Cell,
        velocity: int,
        uncovered: set[Cell],
        random: Xoshiro128PlusPlus,
    ) -> Cell | None:
        """Equation (4): the strongest trail, or a draw from equation (6); None at a dead end."""
        straight_on = DIRECTIONS.index(heading)
        attraction: dict[Cell, float] = {}
        for direction in DIRECTIONS[straight_on:] + DIRECTIONS[:straight_on]:
            there = self.around[here].get(direction)
            if there in uncovered:
                eta = 1.0 / self.distance(there, direction, velocity, uncovered)  # Eq. (5)
                attraction[direction] = self.trail[here, there] * eta**self.config.beta
        if not attraction:
            return None
        strongest = max(attraction, key=lambda direction: attraction[direction])
        if len(attraction) == 1 or random.uniform() <= self.config.q0:
            return strongest
        total = 0.0
        for value in attraction.values():
            total += value
        left = random.uniform() * total
        for direction, value in attraction.items():
            left -= value
            if left < 0:
                return direction
        return direction

    def distance(self, there: Cell, direction: Cell, velocity: int, uncovered: set[Cell]) -> int:
        """What visibility is 1 over."""
        if self.config.visibility == "fewest-open":
            return 1 + len(uncovered & set(self.around[there].values()))
        run = 1
        if self.config.visibility == "distance":
            while run < velocity and self.around[there].get(direction) in uncovered:
                there, run = self.around[there][direction], run + 1
        return run

    def shortest(self, here: Cell, goals: set[Cell]) -> list[Cell]:
        """Return the shortest walk to the first of ``goals`` that a breadth-first search meets."""
        before: dict[Cell, Cell] = {here: here}
        queue = deque([here])
        while queue:
            cell = queue.popleft()
            for direction in DIRECTIONS:
                after = self.around[cell].get(direction)
                if after is None or after in before:
                    continue
                before[after] = cell
                if after in goals:
                    way = [after]
                    while way[0] != here:
                        way.insert(0, before[way[0]])
                    return way
                queue.append(after)
        raise ValueError("no goal can be reached")

    def settle(self, walk: list[Cell]) -> None:
        """Local update, equation (7), for every move."""
        alpha, tau0 = self.config.alpha, self.config.tau0
        for move in itertools.pairwise(walk):
            self.trail[move] = (1.0 - alpha) * self.trail[move] + alpha * tau0

    def strengthen(self, best: list[Cell]) -> None:
        """Global update, equation (8), with delta phi = cells / steps; turns count as steps do."""
        alpha, step = self.config.alpha, self.cost.step_us
        amount = float(Fraction(len(self.to_cover) * step, max(walk_us(best, self.cost), step)))
        for move in itertools.pairwise(best):
            self.trail[move] = (1.0 - alpha) * self.trail[move] + alpha * amount


def fasaco(
    steps: NDArray[np.uint8],
    to_cover: NDArray[np.bool_],
    start: Cell,
    config: ColonyConfig,
    end: Cell | None = None,
    cost: CoverageCost | None = None,
) -> list[Cell]:
    """Algorithm 1: return the cheapest walk a colony finds.

    Args:
        steps: step masks, uint8 (rows, cols), bit ``1 << direction``, east first,
            counter-clockwise.
        to_cover: bool (rows, cols), cells that need a visit, all reachable from the start.
        start: index (row, col) in the arrays.
        config: the colony.
        end: index (row, col) where every walk ends; None for anywhere.
        cost: of steps and turns; None for steps alone.
    """
    around = neighbours(steps)
    trail = {(here, there): config.tau0 for here in around for there in around[here].values()}
    wanted = {(int(row), int(col)) for row, col in np.argwhere(to_cover)}
    cost = cost or CoverageCost()
    colony = Colony(around, wanted, config, end, trail, cost)
    group_size = min(max(64_000 // len(wanted), 2), 32)
    best: list[Cell] = []
    for number, cohort in enumerate(config.cohorts()):
        words = np.random.SeedSequence((config.seed, number)).generate_state(4 * cohort.ants)
        # Ants of a group walk at the same time; what they leave is for the next group.
        for first in range(0, cohort.ants, group_size):
            walks = []
            for ant in range(first, min(first + group_size, cohort.ants)):
                random = Xoshiro128PlusPlus([int(word) for word in words[4 * ant : 4 * ant + 4]])
                walks.append(colony.walk(start, cohort.velocity, random))
            for walk in walks:
                colony.settle(walk)
                if not best or walk_us(walk, cost) < walk_us(best, cost):
                    best = walk
        colony.strengthen(best)
    return best


def walk_us(
    walk: list[Cell], cost: CoverageCost, room_of: Callable[[Cell], object] = lambda _: None
) -> int:
    """Return what a walk costs [us], turn by turn."""
    headings = [
        DIRECTIONS.index(_difference(here, there)) for here, there in itertools.pairwise(walk)
    ]
    total = len(headings) * cost.step_us
    total += sum(cost.col_us if heading % 2 else cost.row_us for heading in headings)
    rooms = itertools.pairwise(room_of(cell) for cell in walk)
    total += sum(one != other for one, other in rooms) * cost.room_us
    for before, after in itertools.pairwise(headings):
        to_left = (after - before) % 4
        total += min(to_left, 4 - to_left) * cost.quarter_turn_us
    return total


def figures(steps: NDArray[np.uint8], walk: list[Cell]) -> dict[str, int]:
    """Count what ``WalkFigures`` names, entry by entry."""
    visits: dict[Cell, int] = {}
    for cell in walk:
        visits[cell] = visits.get(cell, 0) + 1
    moves = [_difference(here, there) for here, there in itertools.pairwise(walk)]
    turns = list(itertools.pairwise(moves))
    backwards = [(before, after) for before, after in turns if after == (-before[0], -before[1])]
    straight = [(before, after) for before, after in turns if after == before]
    revisits = len(walk) - len(visits)
    return {
        "cells": len(visits),
        "steps": len(moves),
        "revisits": revisits,
        "recovered_cells": sum(count >= 2 for count in visits.values()),
        "n_r_paper": revisits + distances(steps, walk[-1])[walk[0]],
        "turns_90": len(turns) - len(straight) - len(backwards),
        "turns_180": len(backwards),
    }


def _difference(here: Cell, there: Cell) -> Cell:
    return there[0] - here[0], there[1] - here[1]


@dataclass
class Classified:
    """The twin's lattice; ``sure`` is False where rounding alone decides."""

    states: NDArray[np.uint8]
    steps: NDArray[np.uint8]
    sure: NDArray[np.bool_]


def classify(
    cells: NDArray[np.int8], geometry: GridGeometry, window: Window, footprint: Footprint
) -> Classified:
    """Return the states and step masks of the lattice cells in ``window``.

    All in metres of the map frame: pixels are squares there, turned by the origin's
    yaw; the robot's disc, swept from one centre to another, touches those whose
    distance from the segment is below its radius.
    """
    ground = _Ground(cells, geometry, footprint)
    shape = window.rows, window.cols
    states, steps = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    sure = np.ones(shape, bool)
    for row in range(window.rows):
        for col in range(window.cols):
            centre = ground.centre(row + window.row0, col + window.col0)
            states[row, col], sure[row, col] = ground.under_sweep(centre, centre)
    for row in range(window.rows):
        for col in range(window.cols):
            for bit, (up, right) in ((0, EAST), (1, NORTH)):
                there = row + up, col + right
                if there[0] >= window.rows or there[1] >= window.cols:
                    continue
                if states[row, col] != COVERABLE or states[there] != COVERABLE:
                    continue
                state, certain = ground.under_sweep(
                    ground.centre(row + window.row0, col + window.col0),
                    ground.centre(there[0] + window.row0, there[1] + window.col0),
                )
                sure[row, col] &= certain
                sure[there] &= certain
                if state == COVERABLE:
                    steps[row, col] |= 2**bit
                    steps[there] |= 2 ** (bit + 2)
    return Classified(states, steps, sure)


class _Ground:
    """Pixels as squares in the map frame."""

    def __init__(
        self, cells: NDArray[np.int8], geometry: GridGeometry, footprint: Footprint
    ) -> None:
        self.cells, self.footprint = cells, footprint
        self.edge = geometry.resolution
        self.tolerance = TOUCH_TOLERANCE_PX * self.edge
        self.radius = max(footprint.robot_radius_m - self.tolerance, self.tolerance)
        # A ring around the map is enough: whoever leaves the map touches it.
        reach = [range(-1, size + 1) for size in (geometry.rows, geometry.cols)]
        turned = complex(math.cos(geometry.origin.yaw), math.sin(geometry.origin.yaw))
        corner = complex(geometry.origin.x, geometry.origin.y)
        squares = [
            (row, col, [corner + turned * self.edge * complex(x, y) for x, y in square])
            for row in reach[0]
            for col in reach[1]
            for square in [[(col, row), (col + 1, row), (col + 1, row + 1), (col, row + 1)]]
        ]
        self.pixels = [(row, col, square, sum(square) / 4) for row, col, square in squares]

    def centre(self, row: int, col: int) -> complex:
        """Return the centre of a lattice cell as x + yi."""
        return complex((col + 0.5) * self.footprint.cell_m, (row + 0.5) * self.footprint.cell_m)

    def under_sweep(self, start: complex, end: complex) -> tuple[int, bool]:
        """Return the worst state under the swept disc, and whether that is beyond rounding."""
        middle = (start + end) / 2
        reach = abs(end - start) / 2 + self.radius + self.edge
        certain, touched = True, set()
        for row, col, square, centre in self.pixels:
            if abs(centre - middle) > reach:
                continue
            distance = segment_to_square(start, end, square)
            certain = certain and abs(distance - self.radius) > 1e-9
            if distance < self.radius:
                touched.add(self.pixel(row, col))
        if BLOCKED in touched:
            return BLOCKED, certain
        return (COVERABLE if touched == {COVERABLE} else UNKNOWN), certain

    def pixel(self, row: int, col: int) -> int:
        """Return the state of a pixel, on the map or off it."""
        rows, cols = self.cells.shape
        if not (0 <= row < rows and 0 <= col < cols):
            return UNKNOWN
        value = int(self.cells[row, col])
        if value >= self.footprint.occupied_at_least:
            return BLOCKED
        return COVERABLE if 0 <= value <= self.footprint.free_at_most else UNKNOWN


def segment_to_square(start: complex, end: complex, square: list[complex]) -> float:
    """Return how far a segment is from a closed square, its corners counter-clockwise."""
    edges = list(zip(square, square[1:] + square[:1], strict=True))
    if all(_cross(b - a, start - a) >= 0 for a, b in edges):
        return 0.0
    if any(_segments_cross(start, end, a, b) for a, b in edges):
        return 0.0
    return min(
        min(point_to_segment(start, a, b), point_to_segment(end, a, b), corner)
        for a, b in edges
        for corner in [point_to_segment(a, start, end)]
    )


def point_to_segment(point: complex, start: complex, end: complex) -> float:
    """Return how far a point is from a segment, which may be a point."""
    along = end - start
    if along == 0:
        return abs(point - start)
    share = ((point - start) * along.conjugate()).real / abs(along) ** 2
    return abs(point - start - along * min(max(share, 0.0), 1.0))


def _cross(a: complex, b: complex) -> float:
    return (a.conjugate() * b).imag


def _segments_cross(a: complex, b: complex, c: complex, d: complex) -> bool:
    return (
        _cross(b - a, c - a) * _cross(b - a, d - a) < 0
        and _cross(d - c, a - c) * _cross(d - c, b - c) < 0
    )


# Directions in the order they are tried, and whether they count from the heading.
SPIRAL = ((SOUTH, EAST, NORTH, WEST), True)
ZIGZAG = ((WEST, EAST, SOUTH, NORTH), False)


def sweep(
    steps: NDArray[np.uint8],
    to_cover: NDArray[np.bool_],
    start: Cell,
    rule: tuple[tuple[Cell, ...], bool],
    *,
    end: Cell | None = None,
) -> list[Cell]:
    """Take the first open neighbour in the rule's order, else go to the nearest open cell."""
    order, from_heading = rule
    around = neighbours(steps)
    uncovered = {(int(row), int(col)) for row, col in np.argwhere(to_cover)} - {start}
    searcher = Colony(around, uncovered, ColonyConfig(), end, {})
    walk, heading = [start], EAST
    while uncovered:
        tried = [_turned(direction, heading) for direction in order] if from_heading else order
        beside = [around[walk[-1]].get(direction) for direction in tried]
        first = next((cell for cell in beside if cell in uncovered), None)
        walk += [first] if first else searcher.shortest(walk[-1], uncovered)[1:]
        heading = _difference(walk[-2], walk[-1])
        uncovered.discard(walk[-1])
    return walk + searcher.way_to_end(walk[-1])


def _turned(direction: Cell, heading: Cell) -> Cell:
    """Return ``direction`` as seen by who heads east, in the map's frame."""
    quarters = DIRECTIONS.index(direction) + DIRECTIONS.index(heading)
    return DIRECTIONS[quarters % 4]


def stc(steps: NDArray[np.uint8], ground: NDArray[np.bool_], start: Cell) -> list[Cell]:
    """Spanning-tree coverage: a closed walk around a tree of 2 x 2 blocks, or parts of them."""
    inside = {(int(row), int(col)) for row, col in np.argwhere(ground)}
    around = {
        cell: {way: after for way, after in ways.items() if after in inside}
        for cell, ways in neighbours(steps).items()
        if cell in inside
    }
    walked: Counter[frozenset[Cell]] = Counter()
    node: dict[Cell, frozenset[Cell]] = {}
    for cell in sorted(inside):
        if cell not in node:
            part = _part_of_block(around, cell, walked)
            node.update(dict.fromkeys(part, part))
    stack, reached = [node[start]], {node[start]}
    while stack:
        leaving = (
            (cell, way)
            for way in DIRECTIONS
            for cell in sorted(stack[-1])
            if way in around[cell] and node[around[cell][way]] not in reached
        )
        cell, way = next(leaving, (None, None))
        if cell is None:
            stack.pop()
            continue
        _join(around, walked, cell, way)
        stack.append(node[around[cell][way]])
        reached.add(stack[-1])
    return _circuit(around, walked, start)


def stc_led_to_end(
    steps: NDArray[np.uint8],
    to_cover: NDArray[np.bool_],
    closed: list[Cell],
    end: Cell,
    cost: CoverageCost,
) -> list[Cell]:
    """Cut a closed walk where all is covered and go to the end; the cheaper way around."""
    wanted = {(int(row), int(col)) for row, col in np.argwhere(to_cover)}
    searcher = Colony(neighbours(steps), wanted, ColonyConfig(), end, {})
    readings = []
    for walk in (closed, closed[::-1]):
        length = 1
        while not wanted <= set(walk[:length]):
            length += 1
        readings.append(walk[:length] + searcher.way_to_end(walk[length - 1]))
    return min(readings, key=lambda walk: walk_us(walk, cost))


def _part_of_block(
    around: dict[Cell, dict[Cell, Cell]], cell: Cell, walked: Counter[frozenset[Cell]]
) -> frozenset[Cell]:
    """Return the part of its 2 x 2 block that hangs together with ``cell``; walk around it."""
    block = {(row, col) for row in _pair(cell[0]) for col in _pair(cell[1])}
    part, tree = [cell], []
    for here in part:
        row_first = sorted(set(around[here].values()) & block, key=lambda to: abs(to[0] - here[0]))
        for after in row_first:
            if after not in part:
                part.append(after)
                tree.append(frozenset((here, after)))
    sides = {frozenset((here, after)) for here in part for after in around[here].values()}
    inner = [side for side in sides if side <= block]
    walked.update(inner if len(inner) == 4 else tree * 2)
    return frozenset(part)


def _pair(index: int) -> tuple[int, int]:
    return index // 2 * 2, index // 2 * 2 + 1


def _join(
    around: dict[Cell, dict[Cell, Cell]], walked: Counter[frozenset[Cell]], cell: Cell, way: Cell
) -> None:
    """Make one closed walk of two: side by side at no cost, else there and back."""
    after = around[cell][way]
    across = frozenset((cell, after))
    for beside in around[cell].values():
        opposite = beside[0] + way[0], beside[1] + way[1]
        if beside[0] // 2 != cell[0] // 2 or beside[1] // 2 != cell[1] // 2:
            continue
        if _difference(cell, beside) in (way, (-way[0], -way[1])):
            continue
        near, far = frozenset((cell, beside)), frozenset((after, opposite))
        parallel = opposite in around[beside].values() and opposite in around[after].values()
        if parallel and walked[near] and walked[far]:
            walked.subtract((near, far))
            walked.update((across, frozenset((beside, opposite))))
            return
    walked[across] += 2


def _circuit(
    around: dict[Cell, dict[Cell, Cell]], walked: Counter[frozenset[Cell]], start: Cell
) -> list[Cell]:
    """Walk every step as often as it is counted: Hierholzer, the leftmost first."""
    stack, circuit = [(start, EAST)], []
    while stack:
        here, heading = stack[-1]
        for turn in (NORTH, EAST, SOUTH, WEST):
            way = _turned(turn, heading)
            step = frozenset((here, around[here].get(way, here)))
            if walked[step] > 0:
                walked[step] -= 1
                stack.append((around[here][way], way))
                break
        else:
            circuit.append(stack.pop()[0])
    return circuit[::-1]


def areas(kinds: NDArray[np.uint8]) -> list[tuple[int, frozenset[Cell]]]:
    """Return all connected areas of a grid as (kind, cells), in the order their first cells come.

    One cell after the other floods its area.
    """
    seen: set[Cell] = set()
    found = []
    for start in map(tuple, np.argwhere(kinds).tolist()):
        if start in seen:
            continue
        area, waiting = {start}, [start]
        while waiting:
            row, col = waiting.pop()
            for up, right in DIRECTIONS:
                there = row + up, col + right
                inside = 0 <= there[0] < kinds.shape[0] and 0 <= there[1] < kinds.shape[1]
                if inside and there not in area and kinds[there] == kinds[row, col]:
                    area.add(there)
                    waiting.append(there)
        found.append((int(kinds[start]), frozenset(area)))
        seen |= area
    return found


def inner_cell(area: frozenset[Cell]) -> Cell:
    """Return the middle of an area's first longest run in a row."""
    runs = []
    for row, col in sorted(area):
        if runs and runs[-1][0] == row and runs[-1][2] == col:
            runs[-1][2] = col + 1
        else:
            runs.append([row, col, col + 1])
    row, first, last = max(runs, key=lambda run: run[2] - run[1])
    return row, (first + last - 1) // 2


def cell_beside(area: frozenset[Cell], allowed: set[Cell]) -> Cell:
    """Return the middle one of the allowed cells beside an area, (-1, -1) where there is none.

    Nor is there any beside an area without a square of two by two cells.
    """
    square = any({(r + 1, c), (r, c + 1), (r + 1, c + 1)} <= area for r, c in area)
    beside = sorted({(r + up, c + right) for r, c in area for up, right in DIRECTIONS} & allowed)
    return beside[len(beside) // 2] if square and beside else (-1, -1)


def certain_pixels(swept: set[Cell], places: list[tuple[float, ...]], tile: Window) -> set[Cell]:
    """The pixels of a tile that lie on swept ones wherever it lay.

    ``places``: of each the row and column of the origin, then what a step along a row adds to the
    column and to the row. Rounded from the corner on that the docstrings of the lookup speak of.
    """
    bounds = [_bounds(place, tile) for place in places]
    around = Window.around(*bounds)
    assert around is not None
    is_near = around.rows * around.cols <= 2**20
    left = set(itertools.product(range(tile.row0, tile.row1), range(tile.col0, tile.col1))) & swept
    for (row0, col0, right, up), alone in zip(places, bounds, strict=True):
        corner = around if is_near else alone
        for row, col in list(left):
            y, x = row + 0.5, col + 0.5
            i = math.floor((right * y + (row0 - corner.row0)) + up * x) + corner.row0
            j = math.floor(((col0 - corner.col0) - up * y) + right * x) + corner.col0
            if (i, j) not in swept:
                left.remove((row, col))
    return left


def _bounds(place: tuple[float, ...], tile: Window) -> Window:
    row0, col0, right, up = place
    corners = itertools.product((tile.row0, tile.row1), (tile.col0, tile.col1))
    points = [(row0 + up * c + right * r, col0 + right * c - up * r) for r, c in corners]
    rows, cols = zip(*points, strict=True)
    low, high = (math.floor(min(rows)) - 1, math.floor(min(cols)) - 1), (max(rows), max(cols))
    return Window(*low, *(math.floor(most) + 2 for most in high))
