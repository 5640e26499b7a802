"""Entity and timeline names of a recording: its interface for blueprints and readers."""

from __future__ import annotations

from typing import Final

APPLICATION: Final = "fasaco_edge"

STATUS_PERIOD_S: Final = 15.0
"""Period at which unchanged statuses are recorded [s]."""
SWEPT_OPACITY: Final = 150
"""Opacity of a completely swept pixel; 255 would hide the layers below."""

WALL_CLOCK: Final = "wall"
"""Timeline: when the recorder received the sample."""
REPLAN: Final = "replan"
"""Timeline: revision of the path in force."""

WORLD: Final = "world"
"""Parent of all spatial drawings; its static transform is their origin, in whole kilometres."""
MAP: Final = "world/map"
REPLAN_WINDOW: Final = "world/replan_window"
REPLAN_REASON: Final = "world/replan_window/reason"
FLOOR: Final = "world/floor"
PHEROMONE: Final = "world/pheromone"
ROOMS: Final = "world/rooms"
"""Outlines of the rooms, with their names."""
ZONES: Final = "world/order/zones"
KEEP_OUT: Final = "world/order/keep_out"
"""Zones and keep-out zones of the order."""
PATH: Final = "world/path/current"
OLD_PATH: Final = "world/path/previous"
ROBOT: Final = "world/robot"
ROBOT_BODY: Final = "world/robot/body"
ROBOT_HEADING: Final = "world/robot/heading"
DRIVEN_PATH: Final = "world/trail"
START: Final = "world/trail/start"
END: Final = "world/trail/end"
"""Marks of the first pose and of the last one."""

# Curves that readers use; ``recording/scene/curves.py`` has all.
COVERED_FRACTION: Final = "metrics/coverage/of_order"
PHEROMONE_RANGE: Final = "metrics/trail"
DAEMON_MEMORY: Final = "metrics/resources/memory/planner"
RECORDER_MEMORY: Final = "metrics/resources/memory/recorder"
RECORDER_CPU_S: Final = "metrics/recorder_cpu_s"

MISSION_STATE: Final = "state/mission"
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

# In a recording of a whole fleet each robot has a tree of its own, ``robots/<name>``.
ROBOTS: Final = "robots"
FLEET: Final = "fleet"
FLEET_NOTES: Final = "fleet/notes"
"""The state of each robot, once a second, in blobs (``fleet.recording.notes``)."""
FLEET_SHARES: Final = "fleet/shares"
"""Cells left to sweep, each in the colour of its robot."""
FLEET_TWICE: Final = "fleet/twice"
"""Cells that two or more robots swept."""
FLEET_LOG: Final = "log/fleet"
