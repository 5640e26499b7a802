"""Missions that need three charges each: the battery is never empty, and little time is lost.

    python -m tests.campaigns.batteries --missions 100 [--cells 4000] [--seed 0]

Takes an hour.

In one process, in simulated time: the daemon's ``Mission``, a robot that does as it is told in a
generated building unknown to it, and the simulated robot's battery, which charges where the robot
stands in its dock. Each building is covered twice. Once with a battery that never drains: what
that takes is the way. Then with one so small that the way needs three charges by the policy's
levels. The bound is the way, and the time in which all that it uses beyond the first full battery
is charged, down to the policy's reserve; what lies above it is driving to the dock and back, and
charge that is left in the end. Exit code 1 where a battery was empty or a mission is not complete.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fasaco_edge.mission.config import BatteryPolicy, Dock, MissionPolicy
from fasaco_edge.mission.events import BatteryReceived, Event, State
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.grids import MAP_FOOTPRINT
from fasaco_edge.simulation.robot import CHARGING, Battery
from tests.benchmarks.buildings import building
from tests.benchmarks.online.buildings import Building, of_grid
from tests.benchmarks.online.mission import Conditions, CountedPlanning, OnlineMission
from tests.benchmarks.online.robot import Pace
from tests.campaigns.services import show

POLICY = BatteryPolicy()
PACE = Pace(speed_m_s=0.25, turn_s=1.5)
CHARGES = 3
# The way in batteries, in the middle between the two that make it three charges.
BATTERIES = (1.0 - POLICY.low) + (CHARGES - 0.5) * (POLICY.enough - POLICY.low)
# In its dock the robot is looked at so often [s].
TICK_S = 2.0
# Moves that a plan may try: a repair needs fewer.
PROPOSALS = 20_000


class ChargingMission(OnlineMission):
    """A mission whose robot has a battery.

    Attributes:
        battery: it.
        charging_s: how long it was charged [s].
    """

    def __init__(self, building: Building, conditions: Conditions, minutes: float) -> None:
        self.battery = Battery(minutes)
        self.charging_s = 0.0
        super().__init__(building, conditions)

    def heard(self) -> Sequence[Event]:
        """Return the battery's level."""
        power = "charging" if self.battery.is_charging else "discharging"
        return (BatteryReceived(round(self.battery.level, 3), power),)

    def _go(self) -> bool:
        """Drive a leg, charge, or stand for a tick; return whether the mission gets on."""
        began, is_docked = self.now, self._mission.state is State.CHARGING
        if is_docked:
            self.now += TICK_S
            self.charging_s += TICK_S
        gets_on = is_docked or super()._go()
        self.battery.tick(self.now - began, moves=not is_docked and gets_on, is_docked=is_docked)
        return gets_on


@dataclass(frozen=True, slots=True)
class Charged:
    """What became of a mission.

    Attributes:
        is_complete: whether the mission said so at its end.
        state: its words.
        charges, lowest: how often it charged; the least level.
        way_s, bound_s, took_s: without a battery; the bound; with it [s].
        charging_s: of that in the dock [s].
    """

    is_complete: bool
    state: str
    charges: int
    lowest: float
    way_s: float
    bound_s: float
    took_s: float
    charging_s: float

    @property
    def above(self) -> float:
        """How far above the bound it is, as a share of that."""
        return self.took_s / self.bound_s - 1.0


def charge(cells: int, seed: int, proposals: int = PROPOSALS) -> Charged:
    """Cover the building of a seed without and with a battery."""
    house = of_grid(building(cells, seed), MAP_FOOTPRINT.cell_m)
    conditions = Conditions(
        range_m=5.0,
        pace=PACE,
        cost=PACE.cost(house.footprint.cell_m, with_turns=True),
        seat=CountedPlanning(seed, proposals),
    )
    way = OnlineMission(house, conditions)
    way.run()
    ((x, y),) = house.lattice.centres(np.array([house.start], np.int32)).tolist()
    policy = MissionPolicy(retries=0, lost_pose_s=0.0, dock=Dock(x_m=x, y_m=y, approach_m=0.0))
    battery_s = way.now / BATTERIES
    bound_s = way.now + (way.now - (1.0 - POLICY.reserve) * battery_s) / CHARGING
    driven = replace(conditions, policy=policy, battery=POLICY)
    mission = ChargingMission(house, driven, battery_s / 60.0)
    mission.run()
    return Charged(
        is_complete=way.done and mission.done,
        state=mission.state,
        charges=mission.battery.charges,
        lowest=mission.battery.lowest,
        way_s=way.now,
        bound_s=bound_s,
        took_s=mission.now,
        charging_s=mission.charging_s,
    )


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--missions", type=int, default=100)
    parser.add_argument("--cells", type=int, default=4000, help="of each building")
    parser.add_argument("--seed", type=int, default=0, help="of the first building")
    args = parser.parse_args()
    warm_up()
    done = []
    for seed in range(args.seed, args.seed + args.missions):
        one = charge(args.cells, seed)
        done.append(one)
        show(
            f"{seed:4} {'complete' if one.is_complete else one.state:9} {one.charges} charges,"
            f" lowest {one.lowest:.1%}, way {one.way_s:5.0f} s, bound {one.bound_s:5.0f} s,"
            f" took {one.took_s:5.0f} s, {one.above:+.1%} (in the dock {one.charging_s:.0f} s)"
        )
    above, lowest = [one.above for one in done], min(one.lowest for one in done)
    good = sum(one.is_complete for one in done)
    show(
        f"{good} of {len(done)} complete; charges {min(one.charges for one in done)} to"
        f" {max(one.charges for one in done)}; lowest level {lowest:.1%}; above the bound: median"
        f" {np.median(above):.1%}, p90 {np.quantile(above, 0.9):.1%}, most {max(above):.1%}"
    )
    return 0 if good == len(done) and lowest > 0.0 else 1


if __name__ == "__main__":
    sys.exit(main())
