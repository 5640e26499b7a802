"""Coverage path planning with fast-spanning ant colonies, for the small computer on a robot.

From Python:

    import fasaco_edge as fe

    plan = fe.plan(fe.load_map("office"))
    plan.xy             # the line to be driven, float64 (n, 2) [m] in the map frame
    plan.swept_share    # of the reachable floor
    plan.plot("office.png")
"""

from __future__ import annotations

from importlib import import_module

__version__ = "0.1.0"

# These names are imported on use, so that commands start without the planners. ``__init__.pyi``
# lists them for type checkers.
_PLACES = {
    "Map": "offline.maps:Map",
    "Plan": "offline.result:Plan",
    "Robot": "config.robot:RobotConfig",
    "Search": "offline.settings:Search",
    "load_map": "offline.maps:load_map",
    "plan": "offline.plan:plan",
    "plan_passes": "offline.passes:plan_passes",
}


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, member = _PLACES[name].partition(":")
    return getattr(import_module(f"{__name__}.{module}"), member)


def __dir__() -> list[str]:
    return sorted((*globals(), *_PLACES))
