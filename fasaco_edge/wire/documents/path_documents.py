"""Path documents: the attachments of paths and of trail fields, and the digest of a path."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Annotated, Self

from fasaco_edge.wire.documents.json_text import (
    Amount,
    Count,
    Document,
    Name,
    Ordinal,
    ZenohId,
    allowed,
)

if TYPE_CHECKING:
    from fasaco_edge.planners.path import CoveragePath


class PlanFigures(Document, frozen=True):
    """The plan that a path follows, at the time of planning; all null without a plan.

    Attributes:
        planner: name of the planner.
        seed: seed of all random streams.
        ants: ants that walked.
        kicks: perturbations of the local search.
        proposals: moves that the local search tried.
        planned_steps: steps of the plan at the time of planning.
        planned_cost_s: seconds the plan takes, by configured speed and turn time.
        lower_bound_steps: no walk has fewer steps.
        lower_bound_cost_s: no walk takes fewer seconds, steps and turns together.
        gap: planned_cost_s / lower_bound_cost_s - 1.
        saved_by_ants_s: seconds saved on the first walk by ants and by the local search of their
            walks.
        saved_by_local_search_s: seconds saved by local search on the first walk, or on the rest of
            the current walk.
        saved_by_velocity_s: saved_by_ants_s for each cohort, by its velocity in cells per move;
            null if ants saved nothing.
    """

    planner: str | None = None
    seed: Count | None = None
    ants: Count | None = None
    kicks: Count | None = None
    proposals: Count | None = None
    planned_steps: Count | None = None
    planned_cost_s: Amount | None = None
    lower_bound_steps: Ordinal | None = None
    lower_bound_cost_s: Amount | None = None
    gap: float | None = None
    saved_by_ants_s: Amount | None = None
    saved_by_local_search_s: Amount | None = None
    saved_by_velocity_s: (
        Annotated[
            dict[str, Amount], allowed(propertyNames={"type": "string", "pattern": "^[0-9]+$"})
        ]
        | None
    ) = None

    @classmethod
    def of(cls, plan: CoveragePath | None) -> Self:
        """Return the figures of the plan that a path follows."""
        if plan is None:
            return cls()
        return cls(
            planner=plan.planner,
            seed=plan.seed,
            ants=plan.work.ants,
            kicks=plan.work.perturbations,
            proposals=plan.work.proposals,
            planned_steps=plan.steps,
            planned_cost_s=round(plan.cost_s, 3),
            lower_bound_steps=plan.lower_bound_steps or None,
            lower_bound_cost_s=round(plan.lower_bound_cost_s, 3) or None,
            gap=None if plan.gap is None else round(plan.gap, 6),
            saved_by_ants_s=round(plan.saved.ants, 3),
            # A repair that keeps the path ahead may cost more than the previous walk: it saves 0.
            saved_by_local_search_s=round(max(plan.saved.local_search, 0.0), 3),
            saved_by_velocity_s={
                str(velocity): round(saved_s, 3) for velocity, saved_s in plan.saved.by_velocity
            }
            or None,
        )


class PathReport(PlanFigures, frozen=True):
    """The path being driven.

    Attributes:
        revision: counts the published paths.
        steps: number of steps when the path was published.
        remaining_steps: steps still to drive.
        line_s: seconds that the path ahead takes.
        line_gap: line_s / bound - 1, bound being the least time of any line that sweeps as much
            floor; null if the line sweeps none.
        reason: why it replaced the previous path.
    """

    revision: Ordinal = 1
    steps: Count = 0
    remaining_steps: Count = 0
    line_s: Amount | None = None
    line_gap: Amount | None = None
    reason: str = ""


class Rectangle(Document, frozen=True):
    """A rectangle along the axes.

    Attributes:
        x_min, y_min, x_max, y_max: [m] in the frame of the map.
    """

    x_min: float
    y_min: float
    x_max: float
    y_max: float


class PathAttachment(PlanFigures, frozen=True):
    """The Zenoh attachment of each path.

    Attributes:
        daemon: Zenoh id of the daemon that published it, ``claim.id`` of its status.
        revision: counts the published paths of a mission, from 1; 0 for the empty path with which
            a daemon begins to plan.
        map_stamp_ns: stamp of the map it was planned on [ns]; 0 without a map.
        map_revision: revision of that map, as in the status; 0 without a map.
        reason: why it replaces the previous path.
        steps: steps from pose to pose.
        plan_ms: duration of planning; 0 if no plan was needed.
        changed: rectangle of the map in which cells appeared, vanished or have other neighbours;
            null if the path has another reason.
        speed_m_s: speed to drive the path at, below the robot's usual speed [m/s]; null for the
            usual speed.
    """

    daemon: ZenohId = ""
    revision: Count = 0
    map_stamp_ns: int = 0
    map_revision: Count = 0
    reason: Name = ""
    steps: Count = 0
    plan_ms: Amount = 0.0
    changed: Rectangle | None = None
    speed_m_s: Amount | None = None


class TrailAttachment(Document, frozen=True):
    """The Zenoh attachment of each field of the living trail.

    In old recordings a field without an attachment is the pheromone of a cohort of ants.

    Attributes:
        revision: revision of the path in force.
        cells: number of cells that the trail spans: cells with a step to another cell.
        branching: mean, over the cells, of the number of directions whose pheromone is close to
            that of the cell's strongest; 1 if one direction is dominant in each cell.
    """

    revision: Count = 0
    cells: Count = 0
    branching: Amount = 0.0


PATH_DIGEST = "path_digest"
"""Topic that replaces a path's message in a recording: the attachment is the path's, the payload is
the ``digest`` of its points, float64 x, y [m]."""
DIGEST_BYTES = 16


def digest(payload: bytes) -> bytes:
    """Return DIGEST_BYTES bytes that are unique to a payload."""
    return hashlib.blake2b(payload, digest_size=DIGEST_BYTES).digest()
