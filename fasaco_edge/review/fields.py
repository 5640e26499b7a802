"""What the members of a review's JSON document mean."""

from __future__ import annotations

from typing import Final

FIELDS: Final = {
    "recording": "what the parts of the run share in their names",
    "files": "each part: path, bytes, torn_bytes (cut off by a crash), ended (in order)",
    "robot, version, config": "of the daemon, as its last status has them",
    "map": "the last one: rows, cols, resolution_m",
    "began": "when the recording began, UTC",
    "duration_s": "from its first entry to its last [s]",
    "state": "what the mission said last",
    "orders": "each order, in a chapter of its own: ordered (`command`, or `itself` for one nobody "
    "gave while it was recorded), at_s, until_s, ended_by (`start` of another, `cancel`, `reset`; "
    "null for the end of the recording), state, complete, covered_cells, coverable_cells",
    "complete": "of the last order: whether the mission came to `done` with no reachable cell, or "
    "no cell of its zones, left over",
    "covered_cells, coverable_cells": "at the end: cells that are reachable, those of them covered",
    "recovered_cells": "cells of these that were covered more than once",
    "unreachable_cells": "cells where the robot would fit but cannot come to",
    "coverage_from": "who counted: `status` (the daemon) or `trail` (from the recorded poses and "
    "the last map, where the daemon's last recorded count is outdated)",
    "reached_s": "when 50, 90, 99 and 100 % of the cells coverable at the end were covered [s]",
    "steps": "moves from cell to cell; a cell counts when the tool passes over its centre",
    "revisits": "visits of cells beyond each one's first",
    "turns_90, turns_180": "quarter-turns and about-turns between steps",
    "driven_m": "length of the trail, without jumps [m]",
    "paths": "paths that were published",
    "replans": "those that came of a plan, without the first of each start of the daemon",
    "replans_by_reason": "how many for each kind of reason",
    "first_plan_ms": "how long the first plan took [ms]",
    "replan_ms_p50, replan_ms_p99, replan_ms_max": "how long replans took [ms], nearest rank",
    "replan_ms_by_reason": "median (p50) and slowest (max) of each kind of reason [ms]",
    "replan_list": "each replan: at_s, revision, reason, plan_ms, steps (to drive); of the plan as "
    "it was made, from where the robot was then: planned_steps, lower_bound_steps, gap (steps over "
    "that bound, as a share of it) and cost_s (driving it, by the configuration); changed, the "
    "rectangle of the map that led to it [m]",
    "plans, plans_unused": "by the turn log: plans that were made, those of them that became no "
    "path, because they found the one there was or did not hold any more",
    "plan_ms_p50, plan_ms_p99, plan_ms_max": "how long they took, the unused ones too [ms]",
    "attempts, attempts_used": "plans that were only to make the path better, and did",
    "memory_mb_max, recorder_memory_mb_max": "most memory of daemon and recorder [MB]",
    "processor_percent_max, threads_max": "of the daemon: processor time over half a minute [% of "
    "a core], threads",
    "restored_cells": "cells that were covered before a restart",
    "states": "seconds in each state",
    "troubles": "each time the mission was degraded, blocked or silent, or the recorder could not "
    "write (`recorder: disk full`, `recorder: stalled`): state, reason, at_s, seconds",
    "worst": "moments that stand out: what, value, unit, at_s, note",
    "faults": "messages that the daemon refused",
    "faults_by_code": "the same by code",
    "recorder_lost": "samples that the recorder says it could not write",
    "samples_missing": "gaps in the numbers of the samples",
    "unreadable": "samples in the recording that could not be decoded, by topic",
    "remarks": "what the recorder wrote into its log",
    "not_recorded": "why a figure is null",
}
"""What each member of the document means."""
