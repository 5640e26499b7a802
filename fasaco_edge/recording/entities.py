"""Names of what a recording holds: they are its interface, for blueprints and for readers."""

from __future__ import annotations

from typing import Final

APPLICATION: Final = "fasaco_edge"

WALL_CLOCK: Final = "wall"
"""Timeline: when the recorder received it."""
REPLAN: Final = "replan"
"""Timeline: revision of the path in force."""
ITER: Final = "iter"
"""Timeline: cohorts seen, over all plans."""

WORLD: Final = "world"
"""All that has a place; far from 0 relative to whole kilometres, its static transform."""
MAP: Final = "world/map"
MAP_CHANGE: Final = "world/map_change"
REPLAN_WINDOW: Final = "world/replan_window"
REPLAN_REASON: Final = "world/replan_window/reason"
COVERAGE: Final = "world/coverage"
PHEROMONE: Final = "world/pheromone"
COHORT: Final = "world/pheromone/cohort"
"""Label of the field: the cohort that left it so."""
DIRECTIONS: Final = "world/directions"
PATH: Final = "world/path/current"
OLD_PATH: Final = "world/path/previous"
ROBOT: Final = "world/robot"
ROBOT_BODY: Final = "world/robot/body"
ROBOT_HEADING: Final = "world/robot/heading"
DRIVEN_PATH: Final = "world/trail"

LATENCY: Final = "metrics/latency"
COVERED_FRACTION: Final = "metrics/coverage/covered"
RECOVERED_FRACTION: Final = "metrics/coverage/recovered"
BEST_STEPS: Final = "metrics/colony/best_steps"
PHEROMONE_RANGE: Final = "metrics/trail"
CELLS: Final = "metrics/cells"
GAP: Final = "metrics/plan/gap"
REMAINING_STEPS: Final = "metrics/path/remaining_steps"
PLANS: Final = "metrics/plans"
ERRORS: Final = "metrics/errors"
MEMORY: Final = "metrics/resources/memory"
PROCESSOR: Final = "metrics/resources/processor"
THREADS: Final = "metrics/threads"

MISSION_STATE: Final = "state/mission"
PLANNER_STATE: Final = "state/planner"
RECORDER_STATE: Final = "state/recorder"

PATH_LOG: Final = "log/path"
MISSION_LOG: Final = "log/mission"
BUS_LOG: Final = "log/bus"
RECORDER_LOG: Final = "log/recorder"

RUN_CARD: Final = "run/card"

INPUTS: Final = "inputs"
"""The inputs of the mission, in batches of samples (``samples``)."""
INPUTS_ARCHETYPE: Final = "Inputs"
INPUTS_COMPONENT: Final = "batch"
