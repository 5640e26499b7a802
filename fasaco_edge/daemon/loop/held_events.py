"""Held events: a mission's first events, from the first map until the mission is loaded."""

from __future__ import annotations

from collections.abc import Sequence

from fasaco_edge.errors import FasacoError, PatchWithoutBase
from fasaco_edge.grid.occupancy import MapPatch, without_base
from fasaco_edge.mission.core.events import (
    BatteryReceived,
    Event,
    MapReceived,
    PatchesLost,
    PatchRun,
    PoseReceived,
    PriorityReceived,
    in_runs,
)

_LOST = (PatchesLost, "")


class HeldEvents:
    """The first events of a mission; bounded, however long loading takes.

    Holds the newest map, with its updates applied, and the newest pose of each of the newest
    two frames: the mission decides which frame counts. A loss of updates is noted until the next
    map.
    """

    def __init__(self, events: Sequence[Event] = ()) -> None:
        # Held events by type and frame, in order of arrival.
        self._held: dict[tuple[type, str], Event] = {}
        for event in events:
            self._held[type(event), _frame(event)] = event

    @property
    def events(self) -> list[Event]:
        """The events, in order of arrival."""
        return list(self._held.values())

    @property
    def has_map(self) -> bool:
        """Whether there is a map."""
        return any(kind is MapReceived for kind, _ in self._held)

    def take(self, events: Sequence[Event]) -> list[FasacoError]:
        """Hold events; return the faults of unusable ones."""
        faults: list[FasacoError] = []
        for event in in_runs(events):
            match event:
                case MapReceived():
                    self._held.pop(_LOST, None)
                    self._hold(event)
                case PoseReceived() | BatteryReceived() | PriorityReceived():
                    self._hold(event)
                case PatchRun(patches):
                    faults += self._apply(patches)
                case PatchesLost(count):
                    faults.append(PatchWithoutBase(f"{count} map updates were lost"))
                    if self.has_map:
                        self._held.setdefault(_LOST, event)
        return faults

    def _hold(self, event: Event) -> None:
        """Hold an event; it replaces events of its type, except the newest in another frame."""
        frame = _frame(event)
        before = [other for kind, other in self._held if kind is type(event)]
        kept = [other for other in before if other not in ("", frame)][-1:]
        for other in before:
            if other not in kept:
                del self._held[type(event), other]
        self._held[type(event), frame] = event

    def _apply(self, patches: Sequence[MapPatch]) -> list[FasacoError]:
        """Apply updates to the held maps; return the faults of updates that cannot be applied."""
        maps = {
            held.grid.frame: held.grid
            for held in self._held.values()
            if isinstance(held, MapReceived)
        }
        if not maps or _LOST in self._held:
            return without_base(patches, updates_lost=bool(maps))
        faults: list[FasacoError] = []
        newest = next(reversed(maps))
        for frame, grid in maps.items():
            # An update in neither frame goes to the newest map, which reports the mismatch.
            theirs = [p for p in patches if (p.frame if p.frame in maps else newest) == frame]
            updated = grid.with_updates(theirs)
            self._held[MapReceived, frame] = MapReceived(updated.grid)
            faults += updated.faults
        return faults


def _frame(event: Event) -> str:
    match event:
        case MapReceived(grid):
            return grid.frame
        case PoseReceived(pose):
            return pose.frame
    return ""  # other events have no frame
