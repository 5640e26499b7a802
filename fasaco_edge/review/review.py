"""A review: all figures of a recorded mission."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import MapTooFar, MapTooLarge
from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.judge.floor import JudgedFloor
from fasaco_edge.judge.pixels import Mask
from fasaco_edge.mission.orders.zones import kept_out, without
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import (
    RecordedSamples,
    RunRecord,
    TimedText,
    read_run_record,
)
from fasaco_edge.recording.scene.runcard import cells_of
from fasaco_edge.review.floor_and_rooms import (
    MILESTONES,
    RoomChapter,
    labels_of,
    room_chapters,
    swept_floor,
    visits_of,
)
from fasaco_edge.review.moments import (
    RECORDER_IN_ORDER,
    TROUBLES,
    Replans,
    Span,
    Stand,
    longest_stand,
    spans_of,
    troubles_at_rest,
)
from fasaco_edge.review.orders import OVER, OrderChapter, chapters, ordered_zones
from fasaco_edge.review.run_data import RunData, gather
from fasaco_edge.wire.documents.settings import FleetSettings, known_settings
from fasaco_edge.wire.topics import TURNS

# Progress is reported with every n-th sample.
REPORT_EVERY = 200

Progress = Callable[[str, int, int], None]
"""Called with the task, the amount done, and the whole amount."""
Item = TypeVar("Item")


Others = Callable[[Iterable[Arrival], FleetSettings, GridGeometry], Mask | None]
"""Returns the pixels that the other robots of a fleet swept, from one robot's turn log."""


def read_review(
    paths: Sequence[Path],
    progress: Progress = lambda *_: None,
    others: Others = lambda *_: None,
) -> Review:
    """Read the parts of one run, and review it.

    Args:
        paths: the files, in any order; they are not changed.
        progress: reports the progress.
        others: called for a robot of a fleet.

    Raises:
        UnreadableRecording: a file is missing, no recording, or without samples.
        DifferentRuns: the parts are not of one run.
    """
    record = read_run_record(
        paths, lambda done, total: progress("reading kB", done // 1000, total // 1000)
    )
    samples = RecordedSamples((), record.batches)
    # The number of the last batch's first sample approximates the number of samples.
    about = max(batch.place.first for batch in record.batches) + 1
    data = gather(_reported(samples, progress, "decoding", about), record.clock)
    return review_of(record, data, samples.missing, others, progress)


def _reported(items: Iterable[Item], progress: Progress, task: str, total: int) -> Iterator[Item]:
    for done, item in enumerate(items):
        if done % REPORT_EVERY == 0:
            progress(task, min(done, total), total)
        yield item


Entered = tuple[float, str, str]
"""Time [s] at which a state was entered, the state, and the reason."""


@dataclass(frozen=True, slots=True, eq=False)
class Review:
    """All figures of a recording; times are the robot's [s] since it began.

    Attributes:
        record: files, plots, states and log of the recording.
        data: data of its samples.
        lattice: lattice over the last map; None without a map or a configuration, or if the map is
            too large or too far away.
        no_lattice: why ``lattice`` is None; "" if it is not.
        visits: number of passes of the tool over each cell, uint16 in the shape of the lattice.
        floor: swept and unswept pixels of the reachable floor that was ordered; None without a
            lattice, or if cells were covered before a restart.
        all_floor: as ``floor``, but of all reachable floor, ordered or not.
        by_others: reachable floor that other robots of the fleet swept, bool (rows, cols); it is
            part of neither ``floor`` nor ``all_floor``. None for a robot alone, or if unknown.
        replans: plans after the first one.
        states: states of the mission, in order.
        recorder_states: states of the recorder, in order.
        longest_stand: longest standstill during a mission; None without any.
        missing: number of samples lost before they were written.
    """

    record: RunRecord
    data: RunData
    lattice: CoverageLattice | None
    no_lattice: str
    visits: NDArray[np.uint16] | None
    floor: JudgedFloor | None
    all_floor: JudgedFloor | None
    by_others: Mask | None
    replans: Replans
    states: tuple[Span, ...]
    recorder_states: tuple[Span, ...]
    longest_stand: Stand | None
    missing: int

    @property
    def duration_s(self) -> float:
        """Duration of the recording [s]."""
        return _end_s(self.record, self.data)

    @property
    def state(self) -> str:
        """The last state of the mission; "" if unknown."""
        names = [span.name for span in self.states if span.name != "silent"]
        return names[-1] if names else ""

    @property
    def covered_share(self) -> NDArray[np.float64]:
        """Times [s] and covered shares of the cells coverable at the end, float64 (n, 2).

        The recorded curve has a point every two seconds: a share of the cells coverable at that
        time. The statuses, four a minute and one at the end, have the
        numbers of cells.
        """
        known = [
            (each.at_s, *cells, each.status.state in OVER)
            for each in self.data.statuses
            if (cells := cells_of(each.status))
        ]
        if not known or not known[-1][2]:
            return np.zeros((0, 2))
        at_s, covered, coverable, is_over = np.array(known, np.float64).T
        drawn = self.record.plots.get(entities.COVERED_FRACTION, np.zeros((0, 2)))
        # The curve lags behind a little: its points after the end of an order are left out.
        before = np.searchsorted(at_s, drawn[:, 0], side="right") - 1
        drawn = drawn[(before < 0) | (is_over[before] == 0)]
        more = drawn[:, 1] * np.interp(drawn[:, 0], at_s, coverable)
        points = np.vstack([np.column_stack((drawn[:, 0], more)), np.column_stack((at_s, covered))])
        points[:, 1] /= coverable[-1]
        found: NDArray[np.float64] = points[np.argsort(points[:, 0], kind="stable")]
        return found

    @property
    def cells(self) -> tuple[int, int] | None:
        """The daemon's last counts of covered and of reachable cells of the order, if known."""
        return self.data.last(cells_of)

    @property
    def complete(self) -> bool | None:
        """Whether the last order was completed; None if unknown."""
        return self.orders[-1].complete

    @property
    def troubles(self) -> list[Span]:
        """The periods with a fault of mission or recorder, in order."""
        mission = [span for span in self.states if span.name in TROUBLES]
        mission += troubles_at_rest(self.data.statuses, self.duration_s)
        recorder = [
            replace(span, name=f"recorder: {span.name}")
            for span in self.recorder_states
            if span.name not in RECORDER_IN_ORDER
        ]
        return sorted(mission + recorder, key=lambda span: span.begin_s)

    @property
    def reached_s(self) -> dict[int, float | None] | None:
        """Time from which the covered share stayed above each of ``MILESTONES`` [s].

        None for a milestone that was not reached. The property is None if no share is known.
        """
        at_s, shares = self.covered_share.T
        if not len(at_s):
            return None
        below = {p: np.flatnonzero(shares < p / 100 - 1e-9) for p in MILESTONES}
        first = {p: int(found[-1]) + 1 if len(found) else 0 for p, found in below.items()}
        return {p: float(at_s[index]) if index < len(at_s) else None for p, index in first.items()}

    @property
    def orders(self) -> tuple[OrderChapter, ...]:
        """The orders, with their results."""
        return chapters(self.data, self.states, self.duration_s)

    @property
    def rooms(self) -> tuple[RoomChapter, ...]:
        """The rooms, with what was done in each; () if no rooms were recorded."""
        return room_chapters(self.data, self.states, self.all_floor)


def review_of(
    record: RunRecord,
    data: RunData,
    missing: int,
    others: Others = lambda *_: None,
    progress: Progress = lambda *_: None,
) -> Review:
    """Return the review of a recording.

    Args:
        record: content of its parts.
        data: data of its samples.
        missing: number of samples lost before they were written.
        others: called for a robot of a fleet.
        progress: reports the progress.
    """
    end_s = _end_s(record, data)
    lattice, no_lattice = _lattice(data)
    states = spans_of(_mission_states(data, record), end_s)
    replans = Replans.of(data.paths)
    floor = all_floor = swept_floor(data, lattice) if lattice else None
    by_others = None
    fleet = known_settings(data.config).fleet
    if all_floor is not None and fleet.name:
        turns = RecordedSamples((), record.batches, (TURNS.name,))
        by_others = others(turns, fleet, all_floor.geometry)
        if by_others is not None:
            by_others &= all_floor.unswept
            floor = all_floor = all_floor.only(~by_others)
    if floor is not None and (zones := ordered_zones(data, chapters(data, states, end_s))):
        floor = floor.only(labels_of(floor.geometry, zones) > 0)
    visits = None
    if lattice:
        poses = zip(data.pose_s, data.poses, strict=True)
        poses_reported = _reported(poses, progress, "poses", len(data.poses))
        visits = visits_of(poses_reported, data.lost_pose_s, lattice)
    return Review(
        record=record,
        data=data,
        lattice=lattice,
        no_lattice=no_lattice,
        visits=visits,
        floor=floor,
        all_floor=all_floor,
        by_others=by_others,
        replans=replans,
        states=states,
        recorder_states=spans_of(
            _entered(record, entities.RECORDER_STATE, entities.RECORDER_LOG), end_s
        ),
        longest_stand=longest_stand(data, states),
        missing=missing,
    )


def _lattice(data: RunData) -> tuple[CoverageLattice | None, str]:
    footprint = data.footprint
    if data.grid is None:
        return None, "there is no map"
    if footprint is None:
        return None, "there is no configuration"
    try:
        lattice = CoverageLattice.from_map(data.grid, footprint)
    except (MapTooLarge, MapTooFar) as error:
        return None, str(error)
    if not data.keep_out:
        return lattice, ""
    cell_m, radius_m = footprint.cell_m, footprint.robot_radius_m
    return without(lattice, kept_out(data.keep_out, lattice.window, cell_m, radius_m)), ""


def _end_s(record: RunRecord, data: RunData) -> float:
    """Return the end of the recording [s], by its drawings and samples."""
    return max(record.clock.seconds(record.ended_ns), data.last_s)


def _mission_states(data: RunData, record: RunRecord) -> list[Entered]:
    published = [(each.at_s, each.status.state, each.status.reason) for each in data.statuses]
    drawn = _entered(record, entities.MISSION_STATE, entities.MISSION_LOG)
    return sorted((*published, *drawn), key=lambda entry: entry[0])


def _entered(record: RunRecord, entity: str, log: str) -> list[Entered]:
    lines = record.texts.get(log, ())
    return [
        (record.clock.seconds(at), state, _reason(lines, at, state))
        for at, state in record.texts.get(entity, ())
    ]


def _reason(lines: Sequence[TimedText], at_ns: int, state: str) -> str:
    """Return the reason in the log for a state entered at ``at_ns``; "" for none."""
    prefix = f"{state}: "
    found = (line for at, line in lines if at == at_ns and line.startswith(prefix))
    return next(found, prefix).removeprefix(prefix)
