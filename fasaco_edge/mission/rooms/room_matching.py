"""Room matching: assigns the regions of a new map to rooms, by the squares they have in common.

A room keeps its squares as long as the map shows floor there that no other room claims, and it
grows over new floor of its region. Other changes must last:

- a region on new ground becomes a room after ``HOLD_NEW`` updates,
- a region that separates from a room becomes a room after ``HOLD_CHANGE`` updates,
- rooms in one region stay divided as before, and join after ``HOLD_CHANGE`` updates,
- a large part of a room in another room's region joins that room after ``HOLD_CHANGE`` updates.

An update without the change counts twice against it, so that a change that comes and goes never
lasts. A room that joined another and separates again gets its number back. Rooms that people have
named, set, split or merged are kept: maps do not join them. From a kept room, a map separates only
a part with much new floor: more than a fifth of the part, or half of it if the room was split or
merged. Two kept rooms in one region stay divided as before. Squares that only the newest maps have
added do not decide which region shows a room. Rooms that the map does not show stay unchanged.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.kernels.rooms.regions import grow
from fasaco_edge.mission.rooms.room_book import (
    LEAST_M2,
    MOST_NUMBER,
    MOST_ROOMS,
    Room,
    RoomBook,
    RoomSheet,
)
from fasaco_edge.mission.rooms.room_raster import BLOCK, Ids, RoomRaster, cut_window, is_cut

Labels = NDArray[np.int32]

# A new region must last HOLD_NEW updates, another change HOLD_CHANGE updates.
HOLD_NEW, HOLD_CHANGE = 4, 32
# Squares have settled in a room after 1 to 2 times this number of updates.
SETTLED = 2 * HOLD_CHANGE
# Decrease of a change's score with an update that does not show it.
PENALTY = 2
# A region shows a room if they share LEAST_SHOWN_M2 [m2], or half of the room if that is less. They
# must also share LEAST_SHARE of the smaller of the two.
LEAST_SHOWN_M2, LEAST_SHARE = 0.5, 0.2
# A region with this share of a room's size shows the whole room: squares of the room outside the
# region are then no floor.
WHOLE = 0.8
# A part of a named or set room stays in it if this share of the part has long belonged to it.
FIRM = 0.8


def slots_of(ids: Ids, numbers: Iterable[int]) -> Ids:
    """Return for each square the index of its number in sorted ``numbers``, from 1; 0 for none."""
    places = np.zeros(MOST_NUMBER + 1, np.uint16)
    ordered = np.array(sorted(numbers), np.int64)
    places[ordered] = np.arange(1, len(ordered) + 1)
    return places[ids]


def common_counts(labels: Labels, slots: Ids, most: int) -> NDArray[np.int64]:
    """Return how many squares each region and each slot share, int64 (n, most + 1)."""
    wide, regions = most + 1, int(labels.max(initial=0)) + 1
    counts = np.zeros(regions * wide, np.int64)
    whole = Window(0, 0, *labels.shape)
    for strip in whole.strips(BLOCK):
        at = strip.slices_in(whole)
        keys = labels[at].astype(np.int64).ravel() * wide + slots[at].ravel()
        counts += np.bincount(keys, minlength=regions * wide)
    return counts.reshape(regions, wide)


@dataclass(slots=True)
class _Region:
    """A region that is no room yet: its label, and the number of updates until it is a room."""

    label: int
    hold: int


class Matching:
    """One update of a sheet.

    Args:
        book, sheet: changed in place; the sheet's raster covers the map's window.
        window: the map's squares.
        labels: regions of these squares, int32 (rows, cols).
    """

    def __init__(self, book: RoomBook, sheet: RoomSheet, window: Window, labels: Labels) -> None:
        self._book, self._sheet, self._window, self._labels = book, sheet, window, labels
        self._square_m2 = sheet.raster.square_m**2
        self._ids = sheet.raster.ids
        self._part = self._ids[window.slices_in(sheet.raster.window)]
        # The rooms' numbers by slot, from 1; slot 0 is floor of no room.
        self._rooms = [0, *sorted(sheet.rooms)]
        self._slots = slots_of(self._part, sheet.rooms)
        self._squares = np.bincount(self._ids.ravel(), minlength=MOST_NUMBER + 1)[self._rooms]
        self._counts = common_counts(labels, self._slots, len(sheet.rooms))
        self._firm = common_counts(labels, self._slots * self._is_settled(), len(sheet.rooms))
        self._areas = self._counts.sum(axis=1)
        self._shown_by = self._find_shown()
        # The room to which squares change, by region and slot.
        self._becomes = np.tile(np.array(self._rooms, np.uint16), (len(self._areas), 1))
        self._to_divide: list[int] = []
        self._regions: list[_Region] = []
        # Changes that this map shows.
        self._changes = set[tuple[str, int, int]]()

    def apply(self, before: Ids) -> None:
        """Change the sheet; ``before``: a copy of its raster's numbers."""
        shows = dict[int, list[int]]()
        for slot, label in self._shown_by.items():
            shows.setdefault(label, []).append(slot)
        for label in range(1, len(self._areas)):
            if not self._areas[label]:
                continue
            slots = shows.get(label, [])
            if len(slots) > 1:
                self._take_shared(label, slots)
            elif slots:
                self._take_one(label, slots[0])
            else:
                self._take_none(label)
        due = self._count_changes()
        for what, room, other in due:
            if what == "move":
                label = self._shown_by[self._rooms.index(other)]
                self._becomes[label, self._rooms.index(room)] = other
        for strip in self._window.strips(BLOCK):
            at = strip.slices_in(self._window)
            self._part[at] = self._becomes[self._labels[at], self._slots[at]]
        self._keep_cuts(before)
        for label in self._to_divide:
            self._divide(label)
        self._number_regions()
        for what, room, other in due:
            if what == "join":
                self._join(room, other)
        self._keep(before)

    def _m2(self, squares: int) -> float:
        return float(squares) * self._square_m2

    def _room(self, slot: int) -> Room:
        return self._sheet.rooms[self._rooms[slot]]

    def _is_settled(self) -> NDArray[np.bool_]:
        """Return which squares have belonged to the same room for some updates."""
        settled = self._sheet.settled
        if settled.square_m != self._sheet.raster.square_m:
            return np.zeros(self._part.shape, np.bool_)
        is_settled: NDArray[np.bool_] = settled.on(self._window) == self._part
        return is_settled

    def _find_shown(self) -> dict[int, int]:
        """Return the region that shows each room, by slot; rooms not shown are missing."""
        found = dict[int, int]()
        if len(self._areas) < 2:
            return found
        for slot in range(1, len(self._rooms)):
            squares = int(self._squares[slot])
            least = min(LEAST_SHOWN_M2 / self._square_m2, 0.5 * squares)
            # Only settled squares decide, unless a room has too few of them.
            counts = self._counts if self._firm[1:, slot].sum() < least else self._firm
            label = int(counts[1:, slot].argmax()) + 1
            common = int(self._counts[label, slot])
            smaller = min(int(self._areas[label]), squares)
            if common and common >= least and common >= LEAST_SHARE * smaller:
                found[slot] = label
        return found

    def _others(self, label: int, *slots: int) -> list[int]:
        """Return the other rooms with squares in a region."""
        there = np.flatnonzero(self._counts[label]).tolist()
        return [slot for slot in there if slot and slot not in slots]

    def _is_border(self, label: int, slot: int) -> bool:
        """Return whether a room's squares in a region are few enough to be noise of its border."""
        squares = int(self._counts[label, slot])
        return self._m2(squares) < LEAST_M2 and squares < 0.5 * self._squares[slot]

    def _take_one(self, label: int, slot: int) -> None:
        """Assign a region that shows one room: its new floor belongs to the room."""
        room = self._rooms[slot]
        self._becomes[label, 0] = room
        for other in self._others(label, slot):
            if self._is_border(label, other):
                self._becomes[label, other] = room
            elif not self._room(other).is_by_hand:
                self._changes.add(("move", self._rooms[other], room))
        if self._areas[label] >= WHOLE * self._squares[slot]:
            self._becomes[0, slot] = 0

    def _take_shared(self, label: int, slots: list[int]) -> None:
        """Assign a region that shows several rooms: they stay divided until they join."""
        self._to_divide.append(label)
        for other in self._others(label, *slots):
            if self._is_border(label, other):
                self._becomes[label, other] = 0
        kept = [slot for slot in slots if self._room(slot).is_kept]
        stays = max(kept, key=lambda slot: self._counts[label, slot], default=min(slots))
        for slot in slots:
            if slot != stays and slot not in kept:
                self._changes.add(("join", self._rooms[slot], self._rooms[stays]))

    def _take_none(self, label: int) -> None:
        """Assign a region that shows no room: it is a part of a room, or new."""
        parent, half = 0, 0.5 * self._areas[label]
        if self._counts[label, 1:].max(initial=0) >= half:
            parent = int(self._counts[label, 1:].argmax()) + 1
        is_kept = parent > 0 and self._room(parent).is_kept
        # A kept room loses no part that it has had for long. But it may have been named when parts
        # of it and of another room were seen as one region.
        least = half if parent and self._room(parent).is_by_hand else FIRM * self._areas[label]
        is_firm = parent > 0 and bool(self._firm[label, parent] >= least)
        if parent and (is_firm or not is_kept):
            self._becomes[label, 0] = self._rooms[parent]
        if is_kept and is_firm:
            return
        if self._m2(self._areas[label]) >= LEAST_M2 and len(self._regions) < MOST_ROOMS:
            self._regions.append(_Region(label, HOLD_CHANGE if parent else HOLD_NEW))

    def _count_changes(self) -> list[tuple[str, int, int]]:
        """Score all pending changes; return the changes that have lasted."""
        scores = dict[tuple[str, int, int], int]()
        for change, score in self._sheet.changes.items():
            if change not in self._changes and score > PENALTY:
                scores[change] = score - PENALTY
        for change in self._changes:
            scores[change] = self._sheet.changes.get(change, 0) + 1
        due = sorted(change for change, score in scores.items() if score >= HOLD_CHANGE)
        for change in due:
            del scores[change]
        self._sheet.note_changes(dict(sorted(scores.items())))
        return due

    def _divide(self, label: int) -> None:
        """Give the new floor of a region to the nearest of its rooms."""
        region = self._labels == label
        box = Window.of(region)
        assert box is not None
        at = slice(box.row0, box.row1), slice(box.col0, box.col1)
        inside, numbers = region[at], self._part[at]
        ids = np.where(inside, numbers, np.uint16(0))
        spread(ids, inside)
        numbers[inside] = ids[inside]

    def _number_regions(self) -> None:
        """Score the regions that are no rooms yet; regions that have lasted become rooms."""
        sheet, before = self._sheet, self._sheet.pending.on(self._window)
        counts = common_counts(self._labels, before, max(sheet.regions, default=0))
        squares = np.bincount(sheet.pending.ids.ravel(), minlength=counts.shape[1])
        pending = sheet.pending.on(sheet.raster.window)
        here = pending[self._window.slices_in(sheet.raster.window)]
        scores, matched, places = dict[int, int](), set[int](), list[tuple[int, int]]()
        for region in self._regions:
            label, score = region.label, 1
            was = int(counts[label, 1:].argmax()) + 1 if counts.shape[1] > 1 else 0
            common = int(counts[label, was]) if was else 0
            smaller = min(int(self._areas[label]), int(squares[was])) if was else 0
            if common and was not in matched and common >= 0.5 * smaller:
                matched.add(was)
                score += sheet.regions.get(was, 0)
            if score >= region.hold and self._make_room(label):
                continue
            places.append((label, score))
        # Regions that this map does not show lose score, but keep their squares.
        numbers = np.zeros(max(sheet.regions, default=0) + 1, np.uint16)
        for was, score in sheet.regions.items():
            if was not in matched and score > PENALTY:
                scores[len(scores) + 1] = score - PENALTY
                numbers[was] = len(scores)
        pending[:] = numbers[pending]
        for label, score in places:
            scores[len(scores) + 1] = score
            here[self._labels == label] = len(scores)
        raster = replace(sheet.raster, ids=pending)
        sheet.note(scores, raster.cropped() if scores else RoomRaster.empty(raster.square_m))

    def _make_room(self, label: int) -> bool:
        """Make a region a room; return False if there is no number for it."""
        inside = self._labels == label
        gone = self._sheet.gone.on(self._window)
        lost = np.bincount(gone[inside], minlength=1)
        lost[0] = 0
        number = int(lost.argmax())
        squares = int(np.count_nonzero(self._sheet.gone.ids == number)) if number else 0
        smaller = min(int(np.count_nonzero(inside)), squares)
        if not number or number in self._sheet.rooms or lost[number] < 0.5 * smaller:
            number = self._book.new_id()
        if not number:
            return False
        self._part[inside] = number
        self._book.put(Room(number))
        return True

    def _join(self, room: int, other: int) -> None:
        """Join a room to another; its squares are kept so that it can get its number back."""
        if room not in self._sheet.rooms or other not in self._sheet.rooms:
            return
        squares = self._ids == room
        gone = self._sheet.gone.on(self._sheet.raster.window)
        gone[squares] = room
        self._sheet.lay(self._sheet.raster, replace(self._sheet.raster, ids=gone).cropped())
        self._ids[squares] = other
        self._book.drop([room])

    def _keep_cuts(self, before: Ids) -> None:
        """Keep the squares under cuts, which the map shows as walls."""
        raster = self._sheet.raster
        for cut in self._sheet.cuts:
            around = cut_window(cut, raster.square_m).intersection(raster.window)
            if around is not None:
                at = around.slices_in(raster.window)
                is_lost = is_cut(around, raster.square_m, cut) & (self._ids[at] == 0)
                self._ids[at][is_lost] = before[at][is_lost]

    def _keep(self, before: Ids) -> None:
        """Restore the squares of kept rooms that lost nearly all; drop other rooms as small."""
        squares = np.bincount(self._ids.ravel(), minlength=self._book.next_id)
        empty = []
        for room in self._book.rooms:
            if self._m2(squares[room.id]) >= 0.5 * LEAST_M2:
                continue
            if room.is_kept:
                self._ids[before == room.id] = room.id
            else:
                empty.append(room.id)
        if empty:
            self._ids[np.isin(self._ids, np.array(empty, np.uint16))] = 0
            self._book.drop(empty)


def spread(ids: Ids, allowed: NDArray[np.bool_]) -> None:
    """Give squares without a number the number of the nearest numbered square, in place.

    Distance is counted in steps over edges of squares.

    Args:
        ids: uint16 (rows, cols), the numbers.
        allowed: bool (rows, cols), the squares to fill and to step on.
    """
    grown = ids.astype(np.int32)
    grow(grown, np.ascontiguousarray(allowed))
    ids[:] = grown
