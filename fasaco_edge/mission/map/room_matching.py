"""Room matching: regions of a new map to the rooms of a sheet, by the squares they have in common.

What is known holds: a room keeps its squares wherever the map shows floor that others do not claim,
and grows over new floor of its region. Changes of what is known must last:

- a region on new ground becomes a room after ``HOLD_NEW`` updates,
- a region that parts from a room becomes one after ``HOLD_CHANGE`` updates,
- rooms in one region are divided as before; after ``HOLD_CHANGE`` updates they are one room,
- a large part of a room in the region of another goes over to it after as many.

An update without the change counts twice against it, so that one that flickers never lasts. A room
that vanished so, and comes back, gets its number back. Rooms that people have named, set, split or
merged are kept: they are neither parted nor joined by a map; two of them in one region are divided
by memory, and those split or merged keep their parts. What a few maps have added to a room says
nothing on where it is. Rooms that the map does not show stay as they are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.kernels.rooms.regions import grow
from fasaco_edge.mission.map.room_book import (
    LEAST_M2,
    MOST_NUMBER,
    MOST_ROOMS,
    Room,
    RoomBook,
    RoomSheet,
)
from fasaco_edge.mission.map.room_raster import BLOCK, Ids, RoomRaster, cut_window, is_cut

Labels = NDArray[np.int32]

# Updates that a change must last.
HOLD_NEW, HOLD_CHANGE = 4, 8
# Squares are settled in a room after so many updates, to twice as many.
SETTLED = 2 * HOLD_CHANGE
# An update without a change takes this from its score.
PENALTY = 2
# A region shows a room if it has this area of it [m2], or half of a smaller room; and this share of
# the smaller of the two.
LEAST_SHOWN_M2, LEAST_SHARE = 0.5, 0.2
# From this share of a room's area on a region shows all of it: its other squares are no floor.
WHOLE = 0.8


def slots_of(ids: Ids, numbers: Iterable[int]) -> Ids:
    """Return squares with the place of their number among ``numbers``, from 1; 0 for none."""
    places = np.zeros(MOST_NUMBER + 1, np.uint16)
    ordered = np.array(sorted(numbers), np.int64)
    places[ordered] = np.arange(1, len(ordered) + 1)
    return places[ids]


def common_counts(labels: Labels, slots: Ids, most: int) -> NDArray[np.int64]:
    """Return how many squares each region and each slot have in common, int64 (n, most + 1)."""
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
    """A region that is no room yet: its label, and after how many updates it becomes one."""

    label: int
    hold: int


class Matching:
    """One update of a sheet.

    Args:
        book, sheet: to change; the sheet's raster covers the map's window.
        window: of the map's squares.
        labels: their regions, int32 (rows, cols).
    """

    def __init__(self, book: RoomBook, sheet: RoomSheet, window: Window, labels: Labels) -> None:
        self._book, self._sheet, self._window, self._labels = book, sheet, window, labels
        self._square_m2 = sheet.raster.square_m**2
        self._ids = sheet.raster.ids
        self._part = self._ids[window.slices_in(sheet.raster.window)]
        # Rooms by their slots, from 1; in all tables slot 0 is floor of no room.
        self._rooms = [0, *sorted(sheet.rooms)]
        self._slots = slots_of(self._part, sheet.rooms)
        self._squares = np.bincount(self._ids.ravel(), minlength=MOST_NUMBER + 1)[self._rooms]
        self._counts = common_counts(labels, self._slots, len(sheet.rooms))
        self._firm = common_counts(labels, self._slots * self._is_settled(), len(sheet.rooms))
        self._areas = self._counts.sum(axis=1)
        self._shown_by = self._find_shown()
        # The new number of squares, by region and slot.
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
        """Return for each room's slot that the map shows the region that shows it."""
        found = dict[int, int]()
        if len(self._areas) < 2:
            return found
        for slot in range(1, len(self._rooms)):
            squares = int(self._squares[slot])
            least = min(LEAST_SHOWN_M2 / self._square_m2, 0.5 * squares)
            # What was added lately says little on where a room is, unless it is all there is.
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
        """Return whether the squares of a room in a region are no more than its border moving."""
        squares = int(self._counts[label, slot])
        return self._m2(squares) < LEAST_M2 and squares < 0.5 * self._squares[slot]

    def _take_one(self, label: int, slot: int) -> None:
        """A region shows one room: its new floor belongs to it."""
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
        """A region shows several rooms: they are divided as before, until they join."""
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
        """A region shows no room: it is a part of one, or new."""
        parent, half = 0, 0.5 * self._areas[label]
        if self._counts[label, 1:].max(initial=0) >= half:
            parent = int(self._counts[label, 1:].argmax()) + 1
            self._becomes[label, 0] = self._rooms[parent]
        # What has come to a kept room lately may turn out to be another one.
        if parent and self._room(parent).is_kept and self._firm[label, parent] >= half:
            return
        if self._m2(self._areas[label]) >= LEAST_M2 and len(self._regions) < MOST_ROOMS:
            self._regions.append(_Region(label, HOLD_CHANGE if parent else HOLD_NEW))

    def _count_changes(self) -> list[tuple[str, int, int]]:
        """Score the changes that this map shows, and others; return those that have lasted."""
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
        """Score regions that are no rooms yet; make those rooms that have lasted."""
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
        # Regions that this map does not show lose; their squares stay.
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
        """Let a room join another; its number waits for it."""
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
        """Give rooms that are kept their squares back if all are lost; drop others without any."""
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
    """Give squares without a number that of the nearest square with one, in place.

    Near is counted in steps over the edges of squares.

    Args:
        ids: uint16 (rows, cols), the numbers.
        allowed: bool (rows, cols), the squares to fill, and to step over.
    """
    grown = ids.astype(np.int32)
    grow(grown, np.ascontiguousarray(allowed))
    ids[:] = grown
