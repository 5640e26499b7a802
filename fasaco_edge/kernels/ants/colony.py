"""Ants of one cohort: equations (4) to (8) and the inner loops of Algorithm 1.

Source: Carr and Wang, "Fast-Spanning Ant Colony Optimisation (FaSACO) for
Mobile Robot Coverage Path Planning", 2022.

===========  ==========================================  ======================
Eq. (4)      pseudo-random proportional rule             ``_choose``
Eq. (5)      visibility; 1 for every neighbour, so       ``_visibility``
             ``eta ** beta`` drops out unless asked for
Eq. (6)      probability of the other branch of (4)      ``_choose``
Eq. (7)      local update, after every move              ``settle``
Eq. (8)      global update along the best walk           ``deposit``
===========  ==========================================  ======================

The ants of a group all walk on the trail that earlier groups left. Then (7) is applied to each of
their moves, ant by ant. So the ants of a group may walk on several threads, and the result does not
depend on the number of threads.

Where the paper does not decide: in a tie of (4) an ant goes straight on; it leaves a dead end by
the shortest walk to the nearest cell not yet covered, and (7) applies to these moves, too. The
paper prints "max p_k" for the second branch of (4), which would equal the first branch; as in ant
colony systems, the direction is drawn with the probabilities (6) instead.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.graph import (
    Graph,
    WalkScratch,
    append_way,
    begin,
    close,
    open_steps_of,
)
from fasaco_edge.kernels.jit import as_value, lean_inner_kernel, lean_kernel
from fasaco_edge.kernels.lattice.reach import walk_cost
from fasaco_edge.kernels.random import draw_unit

# Denominator of eta in equation (5): the distance to a neighbour, which is 1; the distance that an
# ant of this velocity will go; 1 + the number of open cells beside the neighbour (Warnsdorff's
# rule: visit cells first that will soon be cut off).
NEIGHBOUR, DISTANCE, FEWEST_OPEN = 0, 1, 2


class Rules(NamedTuple):
    """Constants of equations (4) to (8), both ends of the walk, and its prices.

    Attributes:
        q0, alpha, tau0: as in the equations.
        start: the cell that all ants start from.
        end: the cell the walk ends in, -1 for anywhere.
        step_us, quarter_turn_us: costs [us].
        visibility: NEIGHBOUR, DISTANCE or FEWEST_OPEN.
        powers: float64, ``(1 / (i + 1)) ** beta`` at index i, for each index in use.
    """

    q0: float
    alpha: float
    tau0: float
    start: int
    end: int
    step_us: int
    quarter_turn_us: int
    visibility: int
    powers: NDArray[np.float64]


class ColonyState(NamedTuple):
    """The ants' graph, trail and rules.

    Attributes:
        graph: its wanted cells, and the end, can all be reached from the start.
        trail: pheromone on the move out of a cell in each direction, float64 (n, 4), > 0.
        rules: constants.
    """

    graph: Graph
    trail: NDArray[np.float64]
    rules: Rules


@lean_inner_kernel
def _visibility(
    colony: ColonyState, scratch: WalkScratch, here: int, direction: int, velocity: int
) -> float:
    """Return eta ** beta of equation (5) for the open neighbour in a direction."""
    graph, rules = colony.graph, colony.rules
    after = here + graph.offsets[direction]
    if rules.visibility == FEWEST_OPEN:
        mask = open_steps_of(graph, scratch, after)
        count = (mask & 1) + (mask >> 1 & 1) + (mask >> 2 & 1) + (mask >> 3)
        return float(rules.powers[count])
    run = 1
    while run < velocity and open_steps_of(graph, scratch, after) >> direction & 1:
        after += graph.offsets[direction]
        run += 1
    return float(rules.powers[run - 1])


@lean_inner_kernel
def _weigh(colony: ColonyState, scratch: WalkScratch, here: int, velocity: int) -> None:
    """Fill ``scratch.weights`` with tau * eta ** beta of the open neighbours."""
    mask = open_steps_of(colony.graph, scratch, here)
    for direction in range(4):
        if mask >> direction & 1:
            eta = _visibility(colony, scratch, here, direction, velocity)
            scratch.weights[0, direction] = colony.trail[here, direction] * eta


@lean_inner_kernel
def _choose(
    mask: int,
    weights: NDArray[np.float64],
    row: int,
    heading: int,
    q0: float,
    random: NDArray[np.int64],
) -> int:
    """Return a direction in ``mask`` by equation (4).

    Weights are float64 (k, 4), of which ``row`` is used; ``random`` is int64 (4,).
    """
    total, best, best_weight = 0.0, heading, 0.0
    for turn in range(4):
        direction = (heading + turn) & 3
        weight = weights[row, direction] * (mask >> direction & 1)
        total += weight
        if weight > best_weight:
            best, best_weight = direction, weight
    if mask & (mask - 1) == 0 or draw_unit(random) <= q0:
        return best
    # Eq. (6)
    left = draw_unit(random) * total
    for turn in range(4):
        direction = (heading + turn) & 3
        if mask >> direction & 1:
            best = direction
            left -= weights[row, direction]
            if left < 0.0:
                break
    return best


@lean_inner_kernel
def _walk_one(
    colony: ColonyState,
    scratch: WalkScratch,
    velocity: int,
    random: NDArray[np.int64],
    walk: NDArray[np.int32],
) -> int:
    """Let one ant walk until every cell is covered; return the walk's length."""
    graph, rules = colony.graph, colony.rules
    remaining = begin(graph, scratch, rules.start)
    walk[0] = rules.start
    here, length, heading = rules.start, as_value(1), as_value(0)
    while remaining > 0:
        mask = open_steps_of(graph, scratch, here)
        if mask == 0:
            length, here = append_way(graph, scratch, walk, length, here, as_value(-1))
            heading = scratch.came_from[here]
            close(graph, scratch, here)
            remaining -= 1
            continue
        if rules.visibility == NEIGHBOUR:
            heading = _choose(mask, colony.trail, here, heading, rules.q0, random)
        else:
            _weigh(colony, scratch, here, velocity)
            heading = _choose(mask, scratch.weights, as_value(0), heading, rules.q0, random)
        # A cohort of velocity v keeps straight on for up to v cells.
        for _ in range(velocity):
            here += graph.offsets[heading]
            if length < walk.size:
                walk[length] = here
            length += 1
            close(graph, scratch, here)
            remaining -= 1
            if not open_steps_of(graph, scratch, here) >> heading & 1:
                break
    if rules.end >= 0 and here != rules.end:
        length, _ = append_way(graph, scratch, walk, length, here, rules.end)
    return length


@lean_kernel
def walk_ants(
    colony: ColonyState,
    scratch: WalkScratch,
    velocity: int,
    streams: NDArray[np.int64],
    walks: NDArray[np.int32],
    lengths: NDArray[np.int64],
) -> None:
    """Let ants walk on a constant trail.

    Args:
        colony: graph, trail and rules.
        scratch: working memory.
        velocity: cells an ant keeps straight on for, at least 1.
        streams: int64 (ants, 4): state of each ant's random stream, words of 32 bits,
            not all zero; advanced in place.
        walks: out, int32 (ants, capacity); a longer walk is cut.
        lengths: out, int64 (ants,), the walks' whole lengths.
    """
    for ant in range(streams.shape[0]):
        lengths[ant] = _walk_one(colony, scratch, velocity, streams[ant], walks[ant])


@lean_inner_kernel
def _pull(colony: ColonyState, walk: NDArray[np.int32], towards: float) -> None:
    """Pull the trail of every move of a walk towards a value, by the weight alpha."""
    graph, trail, alpha = colony.graph, colony.trail, colony.rules.alpha
    for index in range(walk.size - 1):
        here, gap = walk[index], walk[index + 1] - walk[index]
        for direction in range(4):
            # With one column, east and north have the same offset: the mask decides.
            if graph.offsets[direction] == gap and graph.steps[here] >> direction & 1:
                trail[here, direction] = (1.0 - alpha) * trail[here, direction] + alpha * towards
                break


@lean_kernel
def settle(
    colony: ColonyState, walks: NDArray[np.int32], lengths: NDArray[np.int64]
) -> tuple[int, int]:
    """Apply the local update (7) for every move, ant by ant.

    Args:
        colony: its trail is changed.
        walks: int32 (ants, capacity).
        lengths: int64 (ants,).

    Returns:
        Index of the cheapest walk, the first if several are equal, and its cost [us].
    """
    rules = colony.rules
    best, least = 0, 0
    for ant in range(lengths.size):
        walk = walks[ant, : lengths[ant]]
        _pull(colony, walk, rules.tau0)
        cost = walk_cost(walk, rules.step_us, rules.quarter_turn_us)
        if ant == 0 or cost < least:
            best, least = ant, cost
    return best, least


@lean_kernel
def deposit(colony: ColonyState, amount: float, best: NDArray[np.int32]) -> None:
    """Strengthen the trail along ``best``, int32 (n,), by (8), ``amount`` being delta phi."""
    _pull(colony, best, amount)
