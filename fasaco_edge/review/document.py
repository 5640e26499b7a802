"""A review as a JSON document; ``fields.FIELDS`` explains its members."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from msgspec.structs import asdict

from fasaco_edge.drawing.spread import percentile
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.runcard import flat_settings
from fasaco_edge.review.drive import milestones
from fasaco_edge.review.review import Review, seconds_by_state
from fasaco_edge.review.run_data import PublishedPath


def document(review: Review) -> dict[str, Any]:
    """Return all figures of a review; null where a recording does not hold them."""
    record, data = review.record, review.data
    grid, counts, walk, drive = data.grid, review.counts, review.walk, review.drive
    replans, faults = review.replans, review.faults
    geometry = grid.geometry if grid else None
    began = datetime.fromtimestamp(1e-9 * record.began_ns, UTC)
    members: dict[str, Any] = {
        "recording": record.recording_id,
        "files": [
            {
                "path": str(part.path),
                "bytes": part.bytes,
                "torn_bytes": part.torn_bytes,
                "ended": part.has_footer,
            }
            for part in record.parts
        ],
        "robot": data.robot or None,
        "version": data.version or None,
        "config": dict(flat_settings(data.config)),
        "map": geometry
        and {
            "rows": geometry.rows,
            "cols": geometry.cols,
            "resolution_m": geometry.resolution,
        },
        "began": f"{began:%Y-%m-%dT%H:%M:%SZ}",
        "duration_s": round(review.duration_s, 3),
        "state": review.state or None,
        "complete": review.complete,
        "orders": [
            {
                "ordered": order.ordered,
                "at_s": _rounded(order.begin_s),
                "until_s": _rounded(order.end_s),
                "ended_by": order.ended_by or None,
                "state": order.state or None,
                "complete": order.complete,
                "covered_cells": order.covered,
                "coverable_cells": order.coverable,
            }
            for order in review.orders
        ],
        "covered_cells": counts and counts.covered,
        "coverable_cells": counts and counts.coverable,
        "recovered_cells": counts and counts.recovered,
        "unreachable_cells": counts and counts.unreachable,
        "coverage_from": counts and counts.source,
        "reached_s": _reached(review),
        "steps": walk and walk.steps,
        "revisits": walk and walk.revisits,
        "turns_90": walk and walk.turns_90,
        "turns_180": walk and walk.turns_180,
        "driven_m": drive and round(drive.driven_m, 2),
        "paths": len(data.paths),
        "replans": len(replans.later),
        "replans_by_reason": replans.by_reason,
        "first_plan_ms": replans.first and _rounded(replans.first.plan_ms),
        "replan_ms_p50": _rounded(replans.milliseconds(50)),
        "replan_ms_p99": _rounded(replans.milliseconds(99)),
        "replan_ms_max": _rounded(replans.milliseconds(100)),
        "replan_ms_by_reason": {
            kind: {"p50": _rounded(median), "max": _rounded(most)}
            for kind, (median, most) in replans.spread_by_reason.items()
        },
        "replan_list": [_replan(path) for path in replans.later],
        **_plans(review),
        **_resources(review),
        "restored_cells": review.data.restored_cells,
        "states": {name: round(s, 3) for name, s in seconds_by_state(review.states).items()},
        "troubles": [
            {"state": s.name, "reason": s.reason, "at_s": _rounded(s.begin_s)}
            | {"seconds": _rounded(s.seconds)}
            for s in review.troubles
        ],
        "worst": [
            {"what": m.what, "value": _rounded(m.value), "unit": m.unit, "at_s": _rounded(m.at_s)}
            | {"note": m.note}
            for m in review.moments
        ],
        "faults": faults.total,
        "faults_by_code": faults.by_code,
        "recorder_lost": faults.lost,
        "samples_missing": review.missing,
        "unreadable": dict(data.undecodable),
        "remarks": list(faults.complaints),
    }
    return members | {"not_recorded": _not_recorded(review)}


def _replan(path: PublishedPath) -> dict[str, Any]:
    about = path.about
    return {
        "at_s": _rounded(path.at_s),
        "revision": about.revision,
        "reason": about.reason,
        "plan_ms": _rounded(path.plan_ms),
        "steps": about.steps,
        "planned_steps": about.planned_steps,
        "lower_bound_steps": about.lower_bound_steps,
        "gap": about.gap,
        "cost_s": about.planned_cost_s,
        "changed": about.changed and asdict(about.changed),
    }


def _plans(review: Review) -> dict[str, Any]:
    """Return counts and times of plans by the turn log; null without one."""
    made = review.data.plan_log.plans
    plans = [plan for plan in made if not plan.is_attempt]
    attempts = [plan for plan in made if plan.is_attempt]
    took = [plan.took_ms for plan in plans]
    return {
        "plans": len(plans) if made else None,
        "plans_unused": sum(not plan.is_used for plan in plans) if made else None,
        "plan_ms_p50": _rounded(percentile(took, 50)),
        "plan_ms_p99": _rounded(percentile(took, 99)),
        "plan_ms_max": _rounded(percentile(took, 100)),
        "attempts": len(attempts) if made else None,
        "attempts_used": sum(plan.is_used for plan in attempts) if made else None,
    }


def _resources(review: Review) -> dict[str, Any]:
    curves = {
        "memory_mb_max": f"{entities.MEMORY}/planner",
        "recorder_memory_mb_max": f"{entities.MEMORY}/recorder",
        "processor_percent_max": entities.PROCESSOR,
        "threads_max": entities.THREADS,
    }
    plots = review.record.plots
    return {
        name: _rounded(float(plots[entity][:, 1].max())) if entity in plots else None
        for name, entity in curves.items()
    }


def _reached(review: Review) -> dict[str, float | None] | None:
    if review.drive is None or review.data.restored_cells:
        return None
    moments = milestones(review.first_s, review.drive.coverage.coverable)
    return {str(percent): _rounded(at_s) for percent, at_s in moments.items()}


def _not_recorded(review: Review) -> dict[str, str]:
    data, why = review.data, {}
    if not data.statuses:
        why["robot, version, config, state"] = "there is no status of a daemon"
    if review.drive is None:
        lacks = "no map" if data.grid is None else "no configuration"
        why["steps, revisits, turns_90, turns_180, driven_m, reached_s"] = f"there is {lacks}"
    elif review.data.restored_cells:
        restored = review.data.restored_cells
        why["reached_s"] = (
            f"{restored} cells were covered before, and a recording does not tell which"
        )
    if review.counts is None:
        why["covered_cells, coverable_cells, recovered_cells"] = (
            "the daemon's last recorded count is outdated, and the trail does not tell all"
        )
    if not review.replans.later:
        why["replan_ms_p50, replan_ms_p99, replan_ms_max"] = "no plan was made anew"
    if not data.plan_log.plans:
        why["plans, plans_unused, plan_ms_p50, plan_ms_p99, plan_ms_max, attempts"] = (
            "there is no turn log"
        )
    if review.faults.lost is None:
        why["recorder_lost"] = "no recorded status tells of the recorder"
    return why


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)
