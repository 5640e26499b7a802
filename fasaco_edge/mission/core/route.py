"""Spare time: while the robot drives, what lies further on of its path is made better.

The route: the path the robot was given, and the plan under way for the next one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.events import PathUpdate, PlanBroken, PlanReady, PlanRequest
from fasaco_edge.mission.coverage.progress import DrivenPath
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.sequencer import Sequencer
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.repair import HELD_CELLS

# A path is worth another only if that saves so many steps, and such a share of what is left.
LEAST_STEPS, LEAST_SHARE = 2, 0.002
# The share of time is halved so often at most.
MOST_VAIN = 4
# Where there is nothing to attempt it is asked again so late [s]: to find that out takes a look
# at the whole lattice, and the answer rarely changes from one pose to the next.
SKIPPED_S = 1.0
# After a plan that broke [s].
BROKEN_S = 30.0


class SpareTime:
    """Keeps attempts to a share of a processor core; a share of 0 is none at all.

    Of a path that attempt after attempt makes no better, ever fewer are made.
    """

    def __init__(self, share: float) -> None:
        self._share = share
        self._resting_until = 0.0
        # The path of the last attempt, and how many came to nothing since it is there.
        self._revision = self._vain = 0

    def is_there(self, now: float) -> bool:
        """Tell whether another attempt may begin at ``now`` [s]."""
        return self._share > 0.0 and now >= self._resting_until

    def spend(self, seconds: float, now: float, revision: int) -> None:
        """Note that an attempt at path ``revision`` took so many seconds, and ended at ``now``."""
        self._vain = min(self._vain + 1, MOST_VAIN) if revision == self._revision else 0
        self._revision = revision
        share = self._share / 2**self._vain
        self._resting_until = now + seconds * (1.0 / share - 1.0)

    def rest(self, now: float) -> None:
        """Note that a plan broke at ``now`` [s]."""
        self._resting_until = max(self._resting_until, now + BROKEN_S)

    def skip(self, now: float) -> None:
        """Note that there was nothing to attempt at ``now`` [s]."""
        self._resting_until = now + SKIPPED_S


@dataclass(frozen=True, slots=True)
class Attempt:
    """An attempt to make a path better from one of its cells on.

    Attributes:
        revision: of the path.
        index: where on it the robot is.
        joint: index of that cell.
        problem: that the rest of the path solves, the end of the one that is left.
    """

    revision: int
    index: int
    joint: int
    problem: CoverageProblem

    @classmethod
    def at(cls, path: DrivenPath, revision: int, agenda: Sequencer, number: int) -> Attempt | None:
        """Return attempt ``number``, on a path; None where too little of it is left."""
        # What the robot is about to drive holds still; less than twice that is not worth a thought.
        joint = path.index + HELD_CELLS
        if joint + HELD_CELLS > len(path.cells):
            return None
        row, col = path.cells[path.index].tolist()
        try:
            problem = agenda.problem((row, col), path.ahead, attempt=number).after(HELD_CELLS)
        except FasacoError:
            return None  # the map has changed: a repair is due
        return cls(revision, path.index, joint, problem)

    def joined(self, path: DrivenPath, better: NDArray[np.int32]) -> NDArray[np.int32] | None:
        """Return what is ahead of a better path, int32 (n, 2); None if it is not worth it."""
        if path.index > self.joint:
            return None
        ahead = better[path.index - self.index :]
        return ahead if _is_worth_it(self.problem.cost, path.ahead, ahead) else None


def _is_worth_it(cost: CoverageCost, before: NDArray[np.int32], after: NDArray[np.int32]) -> bool:
    costs_s = cost.of_walk(before)
    least_s = max(LEAST_STEPS * cost.step_s, LEAST_SHARE * costs_s)
    return costs_s - cost.of_walk(after) >= least_s


class Route:
    """Asks for plans, one at a time, and makes paths of them.

    Attributes:
        path: the published path, and how far the robot is on it.
        revision: counts the published paths.
        plans, attempts: count the plans that came back, and the attempts at better paths.
        unchanged, outdated: count those of the plans that led to no path, because they found
            the one there is, or because they did not hold any more.
        wanted: why a new plan is wanted; "" where none is.
        asked: the plan under way.
        now: time of the step [s].
        published_at: when a path was last published, or found to be still right [s].
    """

    def __init__(self, site: MapState, agenda: Sequencer) -> None:
        self.path = DrivenPath.none()
        self.revision = 0
        self.plans = self.attempts = 0
        self.unchanged = self.outdated = 0
        self.wanted = ""
        self.asked: PlanRequest | None = None
        self.now = 0.0
        self.published_at = 0.0
        self._site = site
        self._agenda = agenda
        self._disowned = False
        # Why a plan is wanted that keeps nothing of the path; "" where none is.
        self._anew = ""
        # What has changed since the last plan was asked for, and whether that is why one is wanted.
        self._changed: Window | None = None
        self._is_by_map = False
        self._checked_on: ReachableArea | None = None
        self._attempt: Attempt | None = None
        # How the last plan broke, and when [s]; "" where it did not.
        self._broken = "", 0.0

    @property
    def is_improving(self) -> bool:
        """Whether the plan under way is only to make the path better."""
        return self.asked is not None and self._attempt is not None

    @property
    def _number(self) -> int:
        return self.plans + self.attempts + 1

    def ask(self, problem: CoverageProblem) -> PlanRequest:
        """Ask for the plan that is wanted."""
        reason = self._anew or self.wanted
        changed = self._changed if self._is_by_map and not self._anew else None
        self.asked = PlanRequest(self._number, problem, reason, changed)
        self.want_none()
        return self.asked

    def ask_for_better(self) -> PlanRequest | None:
        """Ask for a better path; None where too little is left of it."""
        self._attempt = Attempt.at(self.path, self.revision, self._agenda, self.attempts + 1)
        if self._attempt is None:
            return None
        self.asked = PlanRequest(self._number, self._attempt.problem, "spare time")
        return self.asked

    def give_up(self, event: PlanBroken) -> None:
        """Take note that the plan under way broke: the same problem would break it again."""
        asked = self.asked
        if asked is None or asked.number != event.number:
            return
        is_improving, disowned = self.is_improving, self._disowned
        self.asked = self._attempt = None
        self._disowned = False
        self.plans += not is_improving
        self.attempts += is_improving
        if not is_improving and not disowned:
            self.outdated += 1
            self.want(self.wanted or asked.reason, asked.changed)
            self._broken = str(event.why), self.now

    def broken_for(self, now: float) -> str:
        """Return why no plan is asked for as yet; "" where one may be."""
        why, since = self._broken
        if why and now - since < BROKEN_S:
            return f"{why}; tried again with the next map, or after {BROKEN_S:g} s"
        return ""

    def mend(self) -> None:
        """Let a plan be asked for although the last one broke: the problem is another."""
        self._broken = "", 0.0

    def want(self, reason: str, changed: Window | None = None) -> None:
        """Want a plan: because the cells in a window have changed, or for another reason."""
        self.wanted = reason
        self._changed = Window.around(self._changed, changed)
        self._is_by_map = changed is not None

    def want_none(self) -> None:
        """Want no plan any more."""
        self.wanted = self._anew = ""
        self._changed = None

    def want_anew(self, reason: str) -> int:
        """Want a plan that keeps nothing of the path; return which of the plans it will be."""
        self.wanted = self._anew = reason
        self.mend()
        return self.plans + (1 if self.asked is None or self.is_improving else 2)

    @property
    def kept(self) -> NDArray[np.int32]:
        """What of the path the next plan is to keep where it can, int32 (n, 2)."""
        return self.path.ahead[:0] if self._anew else self.path.ahead

    def disown(self) -> None:
        """Want no plan any more; what comes back of the one under way is for another order."""
        self.want_none()
        self.mend()
        self._disowned = self.asked is not None

    def take_plan(self, event: PlanReady) -> PathUpdate | None:
        """Publish a plan that was asked for, unless it does not hold any more."""
        asked, ground = self.asked, self._site.ground
        if asked is None or asked.number != event.number:
            return None
        self.asked = None
        disowned, self._disowned = self._disowned, False
        attempt, self._attempt = self._attempt, None
        self.plans += attempt is None
        self.attempts += attempt is not None
        cell = self._site.cell()
        if disowned or cell is None or ground is None:
            self.outdated += attempt is None
            return None
        if attempt is not None:
            return self._take_better(attempt, event, ground)
        cells = self._from_here(event.path.cells, cell, ground)
        if not len(cells) or ground.drivable_prefix(cells) < len(cells):
            self.outdated += 1
            self._changed = Window.around(self._changed, asked.changed)
            if not self.wanted:
                self.want("the map changed while planning", asked.changed)
            return None
        if np.array_equal(cells, self.path.ahead):
            # Nothing to change: whoever drives it need not hear of it again.
            self.unchanged += 1
            self.published_at = self.now
            return None
        return self.publish(cells, asked.reason, event, asked.changed)

    def _take_better(
        self, attempt: Attempt, event: PlanReady, ground: ReachableArea
    ) -> PathUpdate | None:
        """Publish the path with a better rest; None where that is not worth it."""
        if attempt.revision != self.revision:
            return None
        cells = attempt.joined(self.path, event.path.cells)
        if cells is None or ground.drivable_prefix(cells) < len(cells):
            return None
        return self.publish(cells, "better further on", event)

    def _from_here(
        self, cells: NDArray[np.int32], here: Cell, ground: ReachableArea
    ) -> NDArray[np.int32]:
        """Return a fresh plan without what was covered while it was made.

        The robot went on meanwhile: it joins the plan at the first cell that still
        needs a visit. Empty where it cannot come there: it was carried elsewhere.
        """
        window = ground.lattice.window
        open_cells = self._agenda.open_cells(window)
        rows, cols = cells[:, 0] - window.row0, cells[:, 1] - window.col0
        inside = (rows >= 0) & (rows < window.rows) & (cols >= 0) & (cols < window.cols)
        still_open = np.ones(len(cells), bool)
        still_open[inside] = open_cells[rows[inside], cols[inside]]
        first = int(np.argmax(still_open)) if still_open.any() else len(cells) - 1
        lead = ground.shortest_path(here, (int(cells[first, 0]), int(cells[first, 1])))
        return np.concatenate((lead[:-1], cells[first:])) if len(lead) else lead

    def publish(
        self,
        cells: NDArray[np.int32],
        reason: str,
        ready: PlanReady | None = None,
        changed: Window | None = None,
    ) -> PathUpdate:
        """Publish a path in place of the one before."""
        self.revision += 1
        self.published_at = self.now
        self.path = DrivenPath(cells)
        plan, seconds = (ready.path, ready.seconds) if ready else (None, 0.0)
        return PathUpdate(self.revision, cells, reason, plan, seconds, changed)

    def stop(self, reason: str) -> PathUpdate | None:
        """Publish an empty path; None where the robot has none to drive."""
        if not len(self.path.cells):
            return None
        return self.publish(np.empty((0, 2), np.int32), reason)

    def cut_off(self) -> PathUpdate | None:
        """Shorten a path that a new map blocks, at once; a new plan follows.

        Nothing is left of it where the robot's own cell on it is blocked, or is no more.
        """
        ground = self._site.ground
        if ground is None or ground is self._checked_on:
            return None
        self._checked_on = ground
        ahead = self.path.ahead
        holding = ground.drivable_prefix(ahead)
        if holding == len(ahead):
            return None
        row, col = ahead[holding]
        self.want(f"path blocked at cell ({row}, {col})", self._changed)
        return self.publish(ahead[:holding], self.wanted, changed=self._changed)
