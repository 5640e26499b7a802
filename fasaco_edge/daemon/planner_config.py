"""Configuration of the planner."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from fasaco_edge.daemon.section import Section
from fasaco_edge.planners.colony import ColonyConfig, parse_velocities


class PlannerConfig(Section, frozen=True):
    """The colony, see ``planners.colony.ColonyConfig``; and the time one plan may take [s].

    While the robot drives, ``spare_share`` of a processor core goes into making the rest of its
    path better; fasaco with local search alone can do that.

    ``local_search`` is for fasaco alone; without it a plan may end before its budget.

    ``velocities`` is ``8:1`` for cohorts from 8 down to 1, ``1:8``, ``4`` or ``8,4,1``.
    The paper's ants see no further than their neighbours; a robot's see what will soon
    be cut off, which saves it revisits (``fasaco_edge/bench/RESULTS.md``).
    """

    name: Literal["fasaco", "aco", "stc", "spiral-stc", "zigzag"] = "fasaco"
    local_search: bool = True
    ants: Annotated[int, Meta(ge=1, le=1_000_000)] = 200
    velocities: str = "8:1"
    q0: Annotated[float, Meta(ge=0, le=1)] = 0.98
    alpha: Annotated[float, Meta(gt=0, le=1)] = 0.1
    tau0: Annotated[float, Meta(ge=1e-12, le=1e6)] = 0.1
    visibility: Literal["neighbour", "distance", "fewest-open"] = "fewest-open"
    beta: Annotated[float, Meta(ge=0, le=10)] = 2.0
    threads: Annotated[int, Meta(ge=1, le=64)] = 1
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 0
    budget_s: Annotated[float, Meta(gt=0, le=3600)] = 0.1
    spare_share: Annotated[float, Meta(ge=0, le=1)] = 0.05

    def colony(self) -> ColonyConfig:
        """Return these as a colony.

        Raises:
            BadConfiguration: the velocities cannot be read, or there are fewer ants
                than cohorts.
        """
        return ColonyConfig(
            ants=self.ants,
            velocities=parse_velocities(self.velocities),
            q0=self.q0,
            alpha=self.alpha,
            tau0=self.tau0,
            seed=self.seed,
            visibility=self.visibility,
            beta=self.beta,
        )
