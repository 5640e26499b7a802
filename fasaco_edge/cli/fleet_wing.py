"""The interface of commands to the package ``fleet``, which is loaded only on use.

No other module of ``cli`` imports the fleet; the daemon has ``daemon.fleet_wing``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fasaco_edge.fleet.cli.mission import command_fleet
    from fasaco_edge.fleet.cli.review import print_fleet
    from fasaco_edge.fleet.mission.travel import apart
    from fasaco_edge.fleet.recording.recorder import file_name, run_fleet_recorder
    from fasaco_edge.fleet.review.drawing import draw_fleet_mission
    from fasaco_edge.fleet.review.tracks import swept_by_others
    from fasaco_edge.fleet.watch.screen import fleet_on_bus

__all__ = [
    "apart",
    "command_fleet",
    "draw_fleet_mission",
    "file_name",
    "fleet_on_bus",
    "print_fleet",
    "run_fleet_recorder",
    "swept_by_others",
]

_MODULES = {
    "apart": "mission.travel",
    "command_fleet": "cli.mission",
    "draw_fleet_mission": "review.drawing",
    "file_name": "recording.recorder",
    "fleet_on_bus": "watch.screen",
    "print_fleet": "cli.review",
    "run_fleet_recorder": "recording.recorder",
    "swept_by_others": "review.tracks",
}


def __getattr__(name: str) -> object:
    """Load a function of the fleet."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found: object = getattr(import_module(f"fasaco_edge.fleet.{_MODULES[name]}"), name)
    return found
