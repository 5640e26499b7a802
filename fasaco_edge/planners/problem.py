"""Coverage problem: cells to cover, start, cost; and its arrays for the kernels.

In these arrays a cell is a flat index. Ants walk on ``Graph``, the plain lattice; local search
works on ``FramedGround``, the lattice with a border of two cells.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import (
    EndBlocked,
    EndOutsideMap,
    EndUnreachable,
    FasacoError,
    NothingToCover,
    StartBlocked,
    StartOutsideMap,
)
from fasaco_edge.grid.lattice import COVERABLE, UNKNOWN, Cell, CoverageLattice
from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.ants.graph import Graph, WalkScratch
from fasaco_edge.kernels.lattice.reach import reachable_from, shortest_walk, walk_cost
from fasaco_edge.kernels.local_search.walk_array import FRAME, ROOM_BIT, Ground, Prices
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost
from fasaco_edge.planners.living_trail import TrailSnapshot


@dataclass(frozen=True, slots=True, eq=False)
class CoverageProblem:
    """Cover every cell of ``to_cover`` by a walk over the lattice that begins at ``start``.

    Attributes:
        lattice: the cells where the robot fits, and their legal steps.
        start: the cell (row, col) the walk begins in.
        to_cover: bool (rows, cols), read-only: coverable cells, reachable from the start, that
            still need a visit.
        unreachable: bool (rows, cols), read-only: coverable cells that are asked for but not
            reachable; reported, never attempted.
        end: the cell (row, col) where the walk ends, to cover or not; the start for a closed walk;
            None for anywhere.
        cost: the cost to minimise.
        before: int32 (n, 2), the undriven rest of the previous walk; a repair keeps its valid
            parts. None for none.
        is_full: whether to search the whole walk, starting from ``before``, not only to repair it.
        attempt: number of an attempt to improve a valid ``before``, from 1; each attempt tries
            other places. 0 if a plan is needed.
        trail: the mission's living trail, for planners whose ants start from it; None for none.
        whole: the whole problem, if this is its rest after some steps, see ``after``; then a path
            begins with these steps, and has the figures of the whole problem. None for a whole
            problem.
        rooms: uint16 (rows, cols), the room of each cell, 0 for none; None without a price for
            steps from one room into another.
    """

    lattice: CoverageLattice
    start: Cell
    to_cover: NDArray[np.bool_]
    unreachable: NDArray[np.bool_]
    end: Cell | None = None
    cost: CoverageCost = STEPS_ALONE
    before: NDArray[np.int32] | None = None
    attempt: int = 0
    whole: CoverageProblem | None = None
    trail: TrailSnapshot | None = None
    is_full: bool = False
    rooms: NDArray[np.uint16] | None = None

    @classmethod
    def of(
        cls,
        lattice: CoverageLattice,
        start: Cell,
        *,
        covered: NDArray[np.bool_] | None = None,
        end: Cell | None = None,
        cost: CoverageCost = STEPS_ALONE,
        before: NDArray[np.int32] | None = None,
        attempt: int = 0,
        reachable: NDArray[np.bool_] | None = None,
    ) -> CoverageProblem:
        """Pose the problem of covering the reachable cells that are not yet ``covered``.

        Args:
            lattice: the planning grid.
            start: cell (row, col).
            covered: bool (rows, cols), cells that need no visit; None for none.
            end: cell (row, col) of the end; the start for home, None for anywhere.
            cost: prices of steps and turns; by default of steps alone.
            before: int32 (n, 2), the undriven rest of the previous walk; None for none.
            attempt: see above.
            reachable: bool (rows, cols), the cells reachable from the start, if known; None to
                search for them.

        Raises:
            StartOutsideMap, EndOutsideMap: start or end is off the lattice.
            StartBlocked, EndBlocked: the robot does not fit there, or the cell is unknown.
            EndUnreachable: no walk leads from the start to the end.
            NothingToCover: no cell is left to cover.
        """
        _check_cell(lattice, start, "start", StartOutsideMap, StartBlocked)
        if reachable is None:
            reachable = reachable_from(lattice.steps, *lattice.local(start)).astype(bool)
        if end is not None:
            _check_cell(lattice, end, "end", EndOutsideMap, EndBlocked)
            if not reachable[lattice.local(end)]:
                raise EndUnreachable(f"no walk leads from start cell {start} to end cell {end}")
        wanted = lattice.coverable if covered is None else lattice.coverable & ~covered
        to_cover, unreachable = wanted & reachable, wanted & ~reachable
        if not to_cover.any():
            hint = "nothing is left to do: leave out what is covered, or start elsewhere"
            raise NothingToCover("every reachable cell is covered", hint=hint)
        to_cover.flags.writeable = unreachable.flags.writeable = False
        return cls(lattice, start, to_cover, unreachable, end, cost, before, attempt)

    def after(self, driven: int) -> CoverageProblem:
        """Return the problem that remains after some steps of the walk ``before``.

        Raises:
            NothingToCover: these steps cover everything.
        """
        assert self.before is not None
        lead, rest = self.before[:driven], self.before[driven:]
        to_cover = self.to_cover.copy()
        window = self.lattice.window
        to_cover[tuple((lead - (window.row0, window.col0)).T)] = False
        if not to_cover.any():
            raise NothingToCover("every reachable cell is covered on the way")
        to_cover.flags.writeable = False
        row, col = rest[0].tolist()
        return replace(self, start=(row, col), to_cover=to_cover, before=rest, whole=self)

    @property
    def lead(self) -> NDArray[np.int32]:
        """The part of the whole walk before this problem begins, int32 (n, 2)."""
        nothing = np.empty((0, 2), np.int32)
        if self.whole is None or self.whole.before is None or self.before is None:
            return nothing
        return self.whole.before[: len(self.whole.before) - len(self.before)]

    @property
    def only_better(self) -> bool:
        """Whether a valid walk exists already, and a better one is wanted."""
        return self.attempt > 0

    @property
    def can_repair(self) -> bool:
        """Whether there is a previous walk, and repairing it suffices."""
        return not self.is_full and self.before is not None and len(self.before) > 0

    @property
    def cells(self) -> int:
        """Number of cells to cover."""
        return int(np.count_nonzero(self.to_cover))

    @property
    def closed(self) -> bool:
        """Whether the walk is closed."""
        return self.end == self.start

    @property
    def flat_start(self) -> int:
        """The start as a flat index ``row * cols + col``."""
        return self._flat(self.start)

    @property
    def flat_end(self) -> int:
        """The end as a flat index, -1 for anywhere."""
        return -1 if self.end is None else self._flat(self.end)

    def _flat(self, cell: Cell) -> int:
        row, col = self.lattice.local(cell)
        return row * self.lattice.window.cols + col

    def cells_of(self, walk: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return a walk of flat indices, int32 (n,), as cells (row, col), int32 (n, 2)."""
        window = self.lattice.window
        rows, cols = np.divmod(walk, window.cols)
        return np.column_stack((rows + window.row0, cols + window.col0)).astype(np.int32)

    def cost_us(self, walk: NDArray[np.int32], framed: FramedGround | None = None) -> int:
        """Return the price [us] of a walk, int32 (n,), flat indices; framed ones if ``framed``."""
        cost = self.cost
        price_us = int(walk_cost(walk, cost.step_us, cost.quarter_turn_us)) + self._added_us(walk)
        if self.rooms is not None:
            flat = walk if framed is None else framed.unframed(walk)
            price_us += self._rooms_us(self.cells_of(flat))
        return price_us

    def price_us(self, cells: NDArray[np.int32]) -> int:
        """Return the price of a walk [us], int32 (n, 2), cells (row, col)."""
        return self.cost.of_walk_us(cells) + self._rooms_us(cells)

    def _rooms_us(self, cells: NDArray[np.int32]) -> int:
        """Return the prices of a walk's steps into other rooms [us]."""
        if self.rooms is None:
            return 0
        rooms = self.lattice.window.values_at(self.rooms, cells, 0)
        return int(np.count_nonzero(_differ(rooms[:-1], rooms[1:]))) * self.cost.room_us

    @property
    def steps_with_rooms(self) -> NDArray[np.uint8]:
        """The steps of the lattice, with marks on steps into another room, see ``ROOM_BITS``."""
        steps, rooms = self.lattice.steps, self.rooms
        if rooms is None:
            return steps
        into = np.zeros_like(steps)
        east, north = _differ(rooms[:, :-1], rooms[:, 1:]), _differ(rooms[:-1], rooms[1:])
        into[:, :-1] |= east << np.uint8(EAST)
        into[:, 1:] |= east << np.uint8(WEST)
        into[:-1] |= north << np.uint8(NORTH)
        into[1:] |= north << np.uint8(SOUTH)
        return steps | (into & steps) << np.uint8(ROOM_BIT)

    def _added_us(self, walk: NDArray[np.int32]) -> int:
        """Return the additional prices of a walk's steps by their direction [us]."""
        cost, steps = self.cost, walk.size - 1
        if not cost.has_lanes:
            return 0
        # With one column, a step north is a difference of 1, too.
        has_rows = self.lattice.window.cols > 1
        in_rows = int(np.count_nonzero(np.abs(np.diff(walk)) == 1)) if has_rows else 0
        return in_rows * cost.row_us + (steps - in_rows) * cost.col_us

    def led_to_end(self, walk: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return a walk of flat indices, int32 (n,), extended to the end by a shortest path."""
        if self.end is None:
            return walk
        cols = self.lattice.window.cols
        # Plain integers: numpy's would compile a second variant of the kernel.
        here, end = divmod(int(walk[-1]), cols), self.lattice.local(self.end)
        rest = shortest_walk(self.lattice.steps, here, end)
        return np.concatenate((walk, rest[1:, 0] * np.int32(cols) + rest[1:, 1]))


def _differ(one: NDArray[np.uint16], other: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return 1 where two cells belong to two rooms, else 0."""
    differ: NDArray[np.bool_] = (one != other) & (one > 0) & (other > 0)
    return differ.view(np.uint8)


def _check_cell(
    lattice: CoverageLattice,
    cell: Cell,
    role: str,
    outside: type[FasacoError],
    blocked: type[FasacoError],
) -> None:
    window = lattice.window
    if not lattice.contains(cell):
        raise outside(
            f"{role} cell {cell} lies outside rows {window.row0}..{window.row1 - 1}, "
            f"columns {window.col0}..{window.col1 - 1}"
        )
    state = lattice.states[lattice.local(cell)]
    if state != COVERABLE:
        if state == UNKNOWN:
            hint = f"choose a known {role}; `plan --unknown-free` takes unknown ground for free"
            raise blocked(f"{role} cell {cell} is unknown", hint=hint)
        raise blocked(f"{role} cell {cell} is blocked: the robot does not fit there")


def graph_of(problem: CoverageProblem) -> Graph:
    """Return the problem's lattice and cells to cover, as flat indices ``row * cols + col``."""
    steps = problem.lattice.steps
    cols = steps.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    wanted = problem.to_cover.astype(np.uint8)
    open_steps = np.zeros(steps.size + 2 * cols, np.uint8)
    inner = open_steps[cols : cols + steps.size].reshape(steps.shape)
    beside = np.pad(wanted, 1)
    ahead = (beside[1:-1, 2:], beside[2:, 1:-1], beside[1:-1, :-2], beside[:-2, 1:-1])
    for direction, neighbour in enumerate(ahead):
        inner |= steps & (neighbour << direction)
    return Graph(steps.ravel(), wanted.ravel(), open_steps, offsets)


def scratch_for(graph: Graph) -> WalkScratch:
    """Return working memory for one thread."""
    size = graph.steps.size
    return WalkScratch(
        open_steps=np.empty_like(graph.open_steps),
        seen=np.zeros(size, np.int32),
        came_from=np.zeros(size, np.int8),
        queue=np.empty(size, np.int32),
        searches=np.zeros(1, np.int32),
        weights=np.zeros((1, 4)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class FramedGround:
    """The problem's steps and cells to cover with a border, and conversion of flat indices.

    Attributes:
        rows, cols: shape of the lattice, without the border.
        ground: cells as flat indices of the framed lattice.
        prices: prices of walks.
    """

    rows: int
    cols: int
    ground: Ground
    prices: Prices

    @classmethod
    def of(cls, problem: CoverageProblem) -> FramedGround:
        """Add a border to a problem's lattice."""
        rows, cols = problem.to_cover.shape
        steps = np.pad(problem.steps_with_rooms, FRAME)
        needed = np.pad(problem.to_cover.astype(np.int32), FRAME)
        width = cols + 2 * FRAME
        offsets = np.array([1, width, -1, -width], np.int64)
        ground = Ground(steps.ravel(), needed.ravel(), offsets, steps.size)
        cost = problem.cost
        prices = Prices(
            cost.step_us,
            cost.quarter_turn_us,
            problem.end is None,
            row_us=cost.row_us,
            col_us=cost.col_us,
            room_us=cost.room_us,
        )
        return cls(rows, cols, ground, prices)

    @property
    def width(self) -> int:
        """Offset between the flat indices of neighbouring rows."""
        return self.cols + 2 * FRAME

    def framed(self, walk: NDArray[np.int32]) -> NDArray[np.int32]:
        """Convert flat indices of the lattice, int32 (n,), to those of the framed lattice."""
        row, col = np.divmod(walk, np.int32(self.cols))
        return self.framed_at(row, col)

    def framed_at(self, rows: NDArray[np.int32], cols: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return cells by rows and columns of the lattice as flat indices of the framed lattice."""
        return ((rows + FRAME) * self.width + cols + FRAME).astype(np.int32, copy=False)

    def unframed(self, walk: NDArray[np.int32]) -> NDArray[np.int32]:
        """Convert flat indices of the framed lattice, int32 (n,), to those of the lattice."""
        row, col = np.divmod(walk, np.int32(self.width))
        return ((row - FRAME) * self.cols + col - FRAME).astype(np.int32)
