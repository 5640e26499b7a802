"""Closed walks of several robots over one ground, improved together by simulated annealing.

A closed walk is kept as a graph: how often it takes each step between two neighbouring cells, in
either direction (0, 1 or 2 times), such that each cell has an even number of steps. A connected
graph of that kind can be driven through in one closed walk (Euler). Two kinds of proposals:

============  =====================================================================  =============
proposal      what it does to the graph of one robot                                 steps
============  =====================================================================  =============
square        of the four steps around a square, those not taken are taken once,     -4 to +4
              those taken twice once, those taken once no more (or one of them twice)
spike         a step is taken there and back, or no more                             +2, -2
============  =====================================================================  =============

A cell may be passed by several robots, or by one more than once: such spare visits move about
until they meet, as in the local search of one walk. So a robot takes cells over from another by
passing them too, and the other then leaves them out.

The energy is the cost of all walks, and the squares of its deviations from an even share. Costs,
energies and temperatures are integers, so that results are equal on all machines.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.fleet.chance import member, most_energy
from fasaco_edge.kernels.fleet.joining import BROKEN, Memory, energy_of, join, parts_of, take_in
from fasaco_edge.kernels.fleet.walks import DEGREE, NONE, STEP, Walks, cost_at
from fasaco_edge.kernels.jit import kernel, lean_kernel
from fasaco_edge.kernels.random import draw, index_of

# Of 256 proposals those that begin at a spare visit or beside it, and those of spikes.
AT_SPARE, SPIKES = 160, 24


@lean_kernel
def _settle(
    walks: Walks,
    memory: Memory,
    robot: int,
    count: int,
    more: int,
    turn: int,
    mean: int,
    weight: int,
    heat: int,
    random: NDArray[np.uint64],
) -> None:
    """Keep a change at the corners if it is legal and accepted, or else undo it."""
    corners, links, bit = memory.corners, walks.links[robot], 1 << robot
    is_kept = True
    for index in range(count):
        cell = corners[index]
        if not DEGREE[links[cell]] and walks.sets[cell] == bit and cell != walks.starts[robot]:
            is_kept = False  # nobody else passes it
    bits = draw(random)
    limit = most_energy(heat, bits)
    energy = energy_of(walks, robot, more, mean, weight)
    for index in range(count, 4):
        corners[index] = NONE
    if is_kept and energy <= limit:
        side = parts_of(walks, memory, robot, count)
        if side == NONE:
            take_in(walks, memory, robot, more)
            return
        if side != BROKEN and join(
            walks, memory, robot, side, more, turn, mean, weight, limit, draw(random)
        ):
            return
    for index in range(count):
        links[corners[index]] = memory.before[index]


@lean_kernel
def _propose_square(
    walks: Walks,
    memory: Memory,
    cell: int,
    bits: int,
    turn: int,
    mean: int,
    weight: int,
    heat: int,
    random: NDArray[np.uint64],
) -> None:
    """Propose to flip a square with a cell in its corner, for a robot at one of its corners."""
    steps, offsets, corners = walks.steps, walks.offsets, memory.corners
    first = bits & 3
    here = cell
    robots = 0
    for index in range(4):
        direction = (first + index) & 3
        if not steps[here] >> direction & 1:
            return
        corners[index] = here
        robots |= walks.sets[here]
        here += offsets[direction]
    robot = member(robots, walks.starts.size, bits >> 2)
    links = walks.links[robot]
    doubled = bits >> 18 & 7
    for index in range(4):
        memory.before[index] = links[corners[index]]
    before = cost_at(walks, robot, corners, 4, turn)
    for index in range(4):
        direction = (first + index) & 3
        here, there = corners[index], corners[(index + 1) & 3]
        times = links[here] >> 2 * direction & 3
        after = (2 if index == doubled else 0) if times == 1 else 1
        back = (direction + 2) & 3
        links[here] = links[here] & (0xFF ^ 3 << 2 * direction) | after << 2 * direction
        links[there] = links[there] & (0xFF ^ 3 << 2 * back) | after << 2 * back
    more = cost_at(walks, robot, corners, 4, turn) - before
    _settle(walks, memory, robot, 4, more, turn, mean, weight, heat, random)


@lean_kernel
def _propose_spike(
    walks: Walks,
    memory: Memory,
    cell: int,
    bits: int,
    turn: int,
    mean: int,
    weight: int,
    heat: int,
    random: NDArray[np.uint64],
) -> None:
    """Propose that a robot takes a step there and back, or no more."""
    direction = bits & 3
    if not walks.steps[cell] >> direction & 1:
        return
    robot = member(walks.sets[cell], walks.starts.size, bits >> 2)
    links, there, back = walks.links[robot], cell + walks.offsets[direction], (direction + 2) & 3
    times = links[cell] >> 2 * direction & 3
    if times == 1:
        return
    memory.corners[0], memory.corners[1] = cell, there
    memory.before[0], memory.before[1] = links[cell], links[there]
    before = cost_at(walks, robot, memory.corners, 2, turn)
    links[cell] ^= 2 << 2 * direction
    links[there] ^= 2 << 2 * back
    more = cost_at(walks, robot, memory.corners, 2, turn) - before
    _settle(walks, memory, robot, 2, more, turn, mean, weight, heat, random)


@kernel
def anneal(
    walks: Walks,
    turn: int,
    hot: int,
    cold: int,
    weight: int,
    proposals: int,
    random: NDArray[np.uint64],
) -> None:
    """Improve the walks.

    Args:
        walks: changed. Each walk is connected, and together they pass all cells.
        turn: cost of a quarter-turn.
        hot, cold: temperatures from the first proposal to the last, in energy.
        proposals: how many.
        random: stream, uint64 (1,); advanced.
    """
    size = walks.steps.size
    memory = Memory(
        np.zeros(4, np.int64),
        np.zeros(4, np.uint8),
        np.zeros((2, size), np.int32),
        np.zeros(size, np.int64),
        np.zeros(2, np.int64),
    )
    scale = STEP * STEP
    mean = heat = 0
    for number in range(proposals):
        if number & 1023 == 0:
            mean = walks.costs.sum() // walks.starts.size
            heat = (hot * scale + (cold - hot) * scale * number // proposals) // 16
        bits = draw(random)
        count = int(walks.spare_at[size])
        if bits & 255 < AT_SPARE and count:
            cell = int(walks.spare[index_of(bits, count)])
            # Half of them a step or two away.
            for shift in (8, 11):
                direction = bits >> shift & 7
                if direction < 4 and walks.steps[cell] >> direction & 1:
                    cell += walks.offsets[direction]
        else:
            cell = walks.cells[index_of(bits, walks.cells.size)]
        bits = draw(random)
        if bits >> 40 & 255 < SPIKES:
            _propose_spike(walks, memory, cell, bits, turn, mean, weight, heat, random)
        else:
            _propose_square(walks, memory, cell, bits, turn, mean, weight, heat, random)
