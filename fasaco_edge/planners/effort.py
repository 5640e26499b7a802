"""How much a local search tries, and how boldly: what trials on real grids came to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fasaco_edge.kernels.local_search.perturbation import KickRules
from fasaco_edge.planners.cost import CoverageCost

# The temperatures of an annealing: from 1.5 down to 0.2.
LEVELS = tuple(1.5 * (0.2 / 1.5) ** (level / 15) for level in range(16))

WHOLE_WALK = -1
EVERY_CELL = 1 << 30


@dataclass(frozen=True, slots=True)
class Effort:
    """The plan of a local search.

    Attributes:
        heats_us: temperatures of the first improvement, in order [us].
        proposals: proposals for each visit in it, at all temperatures together.
        kick: how to kick.
        patience: kicks without gain after which another walk is begun with.
    """

    heats_us: tuple[int, ...]
    proposals: int
    kick: KickRules
    patience: int


def effort_for(cost: CoverageCost) -> Effort:
    """Return the plan for a cost.

    Where turns are free, what helps is to mix the whole walk at temperature 0. Where
    they are not, annealing takes the place of mixing, and a kick is felt only nearby.
    """
    if not cost.quarter_turn_us:
        mixing = KickRules(
            limit=EVERY_CELL,
            mixing=25,
            radius=WHOLE_WALK,
            heat_us=0,
            patience_us=cost.step_us * 2 // 5,
            loops_of_256=256,
        )
        return Effort((0,), 200, mixing, 100)
    # The trials had turns of 1.5 steps; their temperatures are in steps.
    unit = (cost.step_us + cost.quarter_turn_us) * 2 // 5
    heating = KickRules(
        limit=300,
        mixing=100,
        radius=8,
        heat_us=unit,
        patience_us=unit * 3 // 10,
        loops_of_256=64,
        steady=True,
    )
    heats = tuple(int(np.rint(unit * level)) for level in LEVELS)
    return Effort(heats, 250, heating, 500)


@dataclass(frozen=True, slots=True)
class RepairEffort:
    """The plan of a repair.

    Attributes:
        rules: how to kick.
        kicks: that a neighbourhood gets.
        held_kicks: so many of them hold still what is just ahead of the robot.
    """

    rules: KickRules
    kicks: int
    held_kicks: int


def repair_for(cost: CoverageCost) -> RepairEffort:
    """Return how to improve a mended walk: nothing is taken that gains nothing.

    What is kicked is the neighbourhood of what changed, small enough to be mixed whole
    where turns are free.
    """
    rules = KickRules(
        limit=100,
        mixing=6,
        radius=WHOLE_WALK,
        heat_us=0,
        patience_us=0,
        loops_of_256=256,
        steady=True,
        strict=True,
    )
    if not cost.quarter_turn_us:
        return RepairEffort(rules, 50, 40)
    unit = (cost.step_us + cost.quarter_turn_us) * 2 // 5
    rules = rules._replace(mixing=40, radius=6, heat_us=unit * 3 // 2, loops_of_256=128)
    return RepairEffort(rules, 80, 60)
