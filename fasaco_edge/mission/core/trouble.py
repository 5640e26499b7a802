"""Troubles: faults of robot and inputs, in any state of the mission.

The state names the mission's activity, troubles name the faults at the same time. A trouble changes
the state of a mission that drives to ``degraded``; it does not change a state at rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from fasaco_edge.mission.core.in_dock import DockCurrent
from fasaco_edge.mission.core.parts import MissionParts
from fasaco_edge.mission.core.path_checks import FAR_APART
from fasaco_edge.states import TROUBLED, Activity, State, states_of
from fasaco_edge.text import percent

# Least timeout of poses at rest [s]; timeout of the first map and of the first pose [s].
REST_S = 30.0
# A robot is in trouble after this time at a place that the map makes impossible [s].
IMPOSSIBLE_S = 20.0

# States of a robot that drives, or soon will.
DRIVING = states_of(Activity.DRIVING) - TROUBLED
# States of a mission under way. In other states the robot may be switched off.
UNDER_WAY = states_of(Activity.STARTING)


@dataclass(frozen=True, slots=True)
class Trouble:
    """A fault of the robot or an input.

    Attributes:
        code: one of ``wire.documents.status.TROUBLES``.
        text: what is wrong.
        do: what to do about it.
        since: when it was first found, by the mission's time [s].
    """

    code: str
    text: str
    do: str
    since: float


@dataclass(frozen=True, slots=True)
class Rule:
    """A trouble, the states in which it counts, and how it is found.

    Attributes:
        why: returns what is wrong, "" for nothing; takes the mission's parts, state and time [s].
    """

    code: str
    states: frozenset[State]
    why: Callable[[Troubles, State, float], str]
    do: str


class Troubles:
    """Finds the troubles of a mission.

    Attributes:
        found: the troubles at the last ``update``, in the order of ``RULES``.
    """

    def __init__(self, parts: MissionParts) -> None:
        self.map, self.monitor, self.charging = parts.map, parts.monitor, parts.charging
        self.giving_way, self.standing, self.dock = parts.giving_way, parts.standing, parts.dock
        self.way_out, self.blocked = parts.way_out, parts.blocked
        self.offset, self.policy = parts.line.offset, parts.charging.config.policy
        self.found: tuple[Trouble, ...] = ()
        self._current = DockCurrent(parts.lasting.battery)
        # The last time that the robot was at a possible place, or at rest [s].
        self._possible_at = math.inf

    def continue_from(self, before: Troubles) -> None:
        """Take over the findings and counts of a predecessor, so that no timeout starts again."""
        self.found = before.found
        self.monitor.continue_from(before.monitor)
        self.charging.continue_from(before.charging)
        self.giving_way.continue_from(before.giving_way)
        self.standing.continue_from(before.standing)
        self._current.continue_from(before._current)
        self.offset.continue_from(before.offset)

    def update(self, state: State, now: float) -> None:
        """Find the troubles at ``now`` [s] in a state; to be called once in each step."""
        self.monitor.start_timeouts(now)
        is_docked = state is State.CHARGING or (
            state.is_at_rest and self.dock.holds(is_charging=self._current.is_docked)
        )
        self._current.update(now, is_docked=is_docked)
        before = {trouble.code: trouble.since for trouble in self.found}
        self.found = tuple(
            Trouble(rule.code, why, rule.do, before.get(rule.code, now))
            for rule in RULES
            if state in rule.states and (why := rule.why(self, state, now))
        )

    def no_pose(self, state: State, now: float) -> str:
        """Return why there is no current pose."""
        monitor, limit = self.monitor, self.policy.lost_pose_s
        if state not in DRIVING:
            limit = max(limit, REST_S) if limit else 0.0
            if self.map.pose is None:
                return self.map.why_no_pose() if monitor.pose_silent_s(now) > REST_S else ""
        if not monitor.is_pose_lost(now) or monitor.pose_silent_s(now) <= limit:
            return ""
        kept = ": the path is kept, but nothing counts as covered until one comes"
        if monitor.are_poses_far_apart:
            kept = f": {FAR_APART}, and what lies between them does not count as covered"
        path = kept if state in DRIVING else ""
        return f"no pose for {limit:g} s{path}{self.map.why_other_frame()}"

    def no_map(self, _: State, now: float) -> str:
        """Return why there is no current map."""
        if self.map.ground.lattice is None:
            return self.map.why_no_map() if self.monitor.map_silent_s(now) > REST_S else ""
        if not self.monitor.is_map_stale(now):
            return ""
        return f"no map or update for {self.policy.stale_map_s:g} s: going on with the last one"

    def no_battery(self, state: State, now: float) -> str:
        """Return why the battery level is not known."""
        what = "how full it is" if state is State.CHARGING else "when to charge"
        why = self.charging.silence(now)
        return f"{why}: {what} is not known" if why else ""

    def no_current(self, _: State, now: float) -> str:
        """Return the evidence that the dock gives no current."""
        policy, level = self.charging.policy, self.charging.gauge.level
        if policy is None or level is None or self.charging.silence(now) or level >= policy.enough:
            return ""
        why = self._current.why_none(now)
        return (
            f"in the dock the battery, at {percent(level, 0)}, does not charge: {why}"
            if why
            else ""
        )

    def shut_in(self, _: State, now: float) -> str:
        """Return what shuts the robot in, or why its place has long been impossible; else ""."""
        why = self.way_out.why
        if self.map.area is not None or not why:
            self._possible_at = now
            return why
        self._possible_at = min(self._possible_at, now)
        return f"{why}: pose or map is off" if now - self._possible_at > IMPOSSIBLE_S else ""

    def stands(self, _: State, now: float) -> str:
        """Return the evidence that the robot is stuck; "" for none, or without poses."""
        if self.monitor.is_pose_lost(now):
            return ""
        return self.giving_way.why_stuck(now) or self.standing.why_stuck


RULES = (
    Rule(
        "no_pose",
        UNDER_WAY,
        Troubles.no_pose,
        "check the localiser, the frame of its poses, and the key they come on",
    ),
    Rule(
        "pose_jumped",
        DRIVING,
        lambda troubles, state, now: troubles.monitor.doubt,
        "nothing if it ends by itself; else check the localiser",
    ),
    Rule(
        "no_map",
        UNDER_WAY,
        Troubles.no_map,
        "check the mapper or map server, and the key its maps come on",
    ),
    Rule(
        "no_battery",
        UNDER_WAY,
        Troubles.no_battery,
        "check the battery's driver: percentage has to be a number from 0 to 1",
    ),
    Rule(
        "no_dock",
        UNDER_WAY,
        lambda troubles, state, now: troubles.charging.why_no_dock(),
        "set mission.dock for this map, or bring the robot back to the map of the dock",
    ),
    Rule(
        "no_current",
        frozenset(State) - DRIVING,
        Troubles.no_current,
        "check the dock's power and contacts, and whether the robot stands in it",
    ),
    Rule(
        "shut_in",
        UNDER_WAY,
        Troubles.shut_in,
        "open the way, or drive the robot to free floor by hand",
    ),
    Rule(
        "blocked",
        DRIVING,
        lambda troubles, state, now: troubles.blocked.why(now),
        "nothing if it ends by itself: the robot goes on elsewhere; else look at what holds it",
    ),
    Rule(
        "stands",
        DRIVING,
        Troubles.stands,
        "look at what holds the robot; check that its base drives",
    ),
    Rule(
        "beside_line",
        DRIVING,
        lambda troubles, state, now: troubles.offset.why,
        "check that the pose is that of the tool's centre, and how the base follows its path",
    ),
)
"""In order of their weight: the first is the reason of a degraded mission."""
