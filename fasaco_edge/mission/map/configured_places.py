"""Configured places: zones, keep-out zones, home and dock, valid on one map.

That map is in the configured frame ``map_frame``, or else in the first frame used with these
places; the ledger keeps that frame. On a map in another frame, or of another building, the places
are not used. If keep-out zones are configured, the robot does not drive on such a map, as their
place on it is unknown. After a command ``reset`` the places belong to the map in use.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import msgspec

from fasaco_edge.errors import OrderError, PlacesElsewhere
from fasaco_edge.mission.config import Dock, MissionPolicy, Place
from fasaco_edge.mission.map.placing import located
from fasaco_edge.mission.orders.mask import mask_frame
from fasaco_edge.mission.orders.order import Errand, MissionOrder
from fasaco_edge.mission.rooms.room_book import RoomBook


@dataclass(frozen=True, slots=True)
class PlacesNote:
    """Which map the places of the configuration belong to.

    Attributes:
        of: checksum of these places; "" while they belong to no map.
        frame: frame of that map.
        is_left: whether the map in that frame has shown another building since.
        left_mask: checksum of a received keep-out mask, if the map in its frame has shown another
            building since; else "".
    """

    of: str = ""
    frame: str = ""
    is_left: bool = False
    left_mask: str = ""


NO_PLACES = PlacesNote()


class ConfiguredPlaces:
    """Returns the configured places while the map they belong to is in use.

    Attributes:
        note: which map the places belong to; kept with the order.
        mask_frame: frame of the map that the keep-out mask belongs to; "" for any.
    """

    def __init__(self, policy: MissionPolicy, given: MissionPolicy) -> None:
        """Begin before the first map.

        Args:
            policy: the policy with the places in the frame of the lattice.
            given: the policy with the places as configured.
        """
        self.note = NO_PLACES
        self._policy, self._given = policy, given
        self._names = [
            name for name in ("zones", "keep_out", "home", "dock") if getattr(given, name)
        ]
        # A mask received as a message has its own frame, and may be replaced by another.
        mask = given.keep_out_mask
        self.mask_frame = mask_frame(mask)
        self._mask = f"{zlib.crc32(mask.encode()):08x}" if self.mask_frame else ""
        self._names += ["keep_out_mask"] if mask and not self._mask else []
        values = {name: getattr(given, name) for name in self._names}
        of = msgspec.json.encode((values, given.map_frame))
        self._of = f"{zlib.crc32(of):08x}"
        # The frame in use, "" before the first map; and the last fault reported.
        self._here = self._said = ""

    def enter(self, frame: str) -> PlacesElsewhere | None:
        """Note the frame in use; return a new fault if the places are not valid there."""
        self._here = frame
        if self.note.of != self._of:
            self.note = replace(
                self.note, of=self._of, frame=self._given.map_frame or frame, is_left=False
            )
        before, self._said = self._said, self.why or self._why_no_mask
        return PlacesElsewhere(self._said) if self._said not in ("", before) else None

    def leave_building(self, frame: str) -> None:
        """Note that the map in a frame shows another building; ``enter`` returns the fault.

        If the configuration has changed, its places belong to the new building.
        """
        if self.note.of == self._of and self.note.frame == frame:
            self.note = replace(self.note, is_left=True)
        if self.mask_frame == frame:
            self.note = replace(self.note, left_mask=self._mask)

    def restore(self, note: PlacesNote) -> None:
        """Continue with the map noted before a restart."""
        self.note = note

    def reset(self) -> None:
        """Let the places belong to the next map in use."""
        self.note = NO_PLACES

    @property
    def why(self) -> str:
        """Why the configured places are not used; "" if they are, or if there are none."""
        note = self.note
        if not self._names or note.of != self._of or not self._here:
            return ""
        places = ", ".join(f"mission.{name}" for name in self._names)
        if note.frame != self._here:
            return (
                f"{places}: given for the map in frame {note.frame!r} (mission.map_frame), this "
                f"one is in {self._here!r}"
            )
        return f"{places}: given for another building than the map shows" if note.is_left else ""

    @property
    def why_no_keep_out(self) -> str:
        """Why the keep-out zones of this map are unknown; "" if known, or if none are given."""
        is_given = "keep_out" in self._names or "keep_out_mask" in self._names
        why = self.why if is_given and self.why else self._why_no_mask
        return f"{why}: waits until this map has places, or the other map is back" if why else ""

    @property
    def _why_no_mask(self) -> str:
        is_left = bool(self._mask) and self.note.left_mask == self._mask
        return "keep_out_mask: given for another building than the map shows" if is_left else ""

    @property
    def why_no_dock(self) -> str:
        """Why the robot cannot charge here; "" if it can, or if no place is given."""
        return self.why if self._policy.place("charge") else ""

    @property
    def dock(self) -> Dock | None:
        """The dock; None without one on this map."""
        return None if self.why else self._policy.dock

    def place(self, errand: Errand) -> Place | None:
        """Return the destination of an errand; None without one on this map."""
        return None if self.why else self._policy.place(errand)

    @property
    def frame(self) -> str:
        """The frame of the map that the places belong to; "" while unknown."""
        return self.note.frame if self.note.of == self._of else self._given.map_frame

    def located(self, order: MissionOrder, book: RoomBook) -> MissionOrder:
        """Return an order with its named zones replaced by configured zones or rooms.

        Raises:
            OrderError: no zone or room has the name, or it is on another map.
        """
        named = [zone.name for zone in order.zones if zone.polygon == () and not zone.room]
        names = [name for name in named if book.find(name) is None]
        if names and self.why and order.unknown == "refuse":
            raise OrderError(f"zone {names[0]!r}: {self.why}", hint=PlacesElsewhere.hint)
        return located(order, () if self.why else self._policy.zones, book)
