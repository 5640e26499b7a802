"""Parameters of local search and repair by cost, tuned on real grids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fasaco_edge.kernels.local_search.perturbation import PerturbationRules
from fasaco_edge.planners.cost import CoverageCost

# Temperatures of an annealing, from 1.5 down to 0.2, in the unit of ``effort_for``.
LEVELS = tuple(1.5 * (0.2 / 1.5) ** (level / 15) for level in range(16))

WHOLE_WALK = -1
EVERY_CELL = 1 << 30
# Number of perturbations by ants, which rebuild a disc, among 256.
BY_ANTS = 128


@dataclass(frozen=True, slots=True)
class Effort:
    """Parameters of a search.

    Attributes:
        temperatures_us: temperatures of the first improvement, in order [us].
        proposals: proposals per visit in the first improvement, over all temperatures.
        rules: rules of perturbations.
        patience: perturbations without gain after which a search of one region ends.
    """

    temperatures_us: tuple[int, ...]
    proposals: int
    rules: PerturbationRules
    patience: int


def effort_for(cost: CoverageCost, *, has_ants: bool = True) -> Effort:
    """Return the search parameters for a cost.

    If turns are free, proposals are made all over the walk at temperature 0; otherwise the
    surroundings of a perturbation are annealed.
    """
    by_ants = BY_ANTS if has_ants else 0
    if not (cost.quarter_turn_us or cost.is_priced):
        rules = PerturbationRules(
            limit=EVERY_CELL,
            proposals=25,
            radius=WHOLE_WALK,
            temperature_us=0,
            acceptance_us=cost.step_us * 2 // 5,
            loops_of_256=256 - by_ants,
            ants_of_256=by_ants,
        )
        return Effort((0,), 200, rules, 3_000)
    # The unit of temperatures is a step if a quarter-turn takes 1.5 steps, as in the tuning.
    unit = (cost.step_us + cost.quarter_turn_us) * 2 // 5
    rules = PerturbationRules(
        limit=300,
        proposals=100,
        radius=8,
        temperature_us=unit,
        acceptance_us=unit * 3 // 10,
        loops_of_256=(256 - by_ants) // 4,
        ants_of_256=by_ants,
    )
    temperatures_us = tuple(int(np.rint(unit * level)) for level in LEVELS)
    return Effort(temperatures_us, 250, rules, 15_000)


@dataclass(frozen=True, slots=True)
class RepairEffort:
    """Parameters of a repair.

    Attributes:
        rules: rules of perturbations.
        proposals: number of proposals in a neighbourhood after which no perturbation begins.
            Proposals are counted, as the time of a perturbation differs by a factor of three.
        held: number of these proposals that leave the walk just ahead of the robot unchanged.
        steady_us: largest extra cost of a walk that is preferred because it keeps the next cells
            [us].
    """

    rules: PerturbationRules
    proposals: int
    held: int
    steady_us: int


def repair_for(cost: CoverageCost, *, has_ants: bool = True) -> RepairEffort:
    """Return the repair parameters for a cost: only changes with a gain are accepted.

    If turns are free, proposals are made all over the neighbourhood of a change.
    """
    by_ants = BY_ANTS if has_ants else 0
    rules = PerturbationRules(
        limit=100,
        proposals=6,
        radius=WHOLE_WALK,
        temperature_us=0,
        acceptance_us=0,
        loops_of_256=256 - by_ants,
        ants_of_256=by_ants,
        strict=True,
    )
    if not (cost.quarter_turn_us or cost.is_priced):
        return RepairEffort(rules, 30_000, 24_000, 0)
    unit = (cost.step_us + cost.quarter_turn_us) * 2 // 5
    loops = (256 - by_ants) // 2
    rules = rules._replace(proposals=40, radius=5, temperature_us=unit * 3 // 2, loops_of_256=loops)
    return RepairEffort(rules, 95_000, 70_000, 2 * cost.step_us)
