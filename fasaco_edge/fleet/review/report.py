"""Review of a fleet's recording: makespan, balance, floor swept again, waiting, messages.

A robot drives through floor that others have swept, or sweeps it again. From entry to exit of such
floor, the steps of the shortest way count as driving through, all further steps as sweeping again.

Durations are by the robots' own clocks, which run faster than the recorder's in a simulation. The
recorder's clock decides which robot was first on a cell.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.observer.cells import FAR, Cells, Place, Seat, distances, mask_of, window_of
from fasaco_edge.fleet.recording.notes import Note, read_notes
from fasaco_edge.fleet.review.tracks import RobotTrack, seat_of, seconds_of, tracks_of
from fasaco_edge.grid.geometry import Window
from fasaco_edge.states import AT_WORK

# Time over which the highest rate of messages is averaged [s].
PEAK_S = 5.0
# Notes come once a second: a longer interval means that no message arrived [s].
LONGEST_NOTE_S = 3.0
NEVER_MS = math.inf


class FleetRobotFigures(msgspec.Struct, frozen=True):
    """Figures of one robot of a fleet.

    Attributes:
        name: name of the robot.
        state: its last state.
        busy_s: time of planning or covering, without waiting [s].
        waited_s: time of waiting or making way for another robot [s].
        waits, longest_wait_s: number of waits; the longest wait [s].
        driven_m: distance driven, by its poses [m].
        swept_m2: area of the cells that it swept [m2].
        through_m2: area of these cells that it only drove through, after another robot [m2].
        again_m2: area of these cells that it swept again, after another robot [m2].
        messages_s, kb_s: rate of its messages to the fleet [1/s], [kB/s].
        peak_kb_s: the highest rate over five seconds [kB/s].
        plans: number of plans reported.
        plan_ms_p50, plan_ms_p99: time of a plan [ms]; null without plans.
    """

    name: str
    state: str
    busy_s: float
    waited_s: float
    waits: int
    longest_wait_s: float
    driven_m: float
    swept_m2: float
    through_m2: float
    again_m2: float
    messages_s: float
    kb_s: float
    peak_kb_s: float
    plans: int
    plan_ms_p50: float | None
    plan_ms_p99: float | None


class FleetFigures(msgspec.Struct, frozen=True):
    """Figures of a fleet.

    Attributes:
        fleet: its name.
        time_scale: simulated seconds per second, as configured for the first robot; 1 if real.
        duration_s: duration of the recording [s].
        makespan_s: time from the first robot's start of work to the last robot's end [s].
        busy_balance: shortest over longest of the robots' times at work.
        swept_balance: smallest over largest of the robots' swept areas.
        swept_m2: area of the cells that any robot swept [m2].
        through_m2, again_m2: sums over the robots [m2].
        again_share: ``again_m2`` as a share of ``swept_m2``.
        waited_s: sum over the robots [s].
        divisions: number of the last division.
        robots: figures of each robot.
    """

    fleet: str
    time_scale: float
    duration_s: float
    makespan_s: float
    busy_balance: float
    swept_balance: float
    swept_m2: float
    through_m2: float
    again_m2: float
    again_share: float
    waited_s: float
    divisions: int
    robots: list[FleetRobotFigures]


@dataclass(frozen=True, slots=True, eq=False)
class FleetReview:
    """Contents of a fleet's recording.

    Attributes:
        figures: figures of the fleet.
        seat: placement of the lattice of all cells.
        ground: cells that any robot could reach, int64 (n, 2).
        tracks: the track of each robot.
    """

    figures: FleetFigures
    seat: Seat
    ground: Cells
    tracks: list[RobotTrack]


def review_fleet(paths: Sequence[Path]) -> FleetReview:
    """Read the parts of a fleet's recording.

    Raises:
        UnreadableRecording: a file is missing, damaged, or no recording of a fleet.
        DifferentRuns: the parts are not of one run.
    """
    batches = read_notes(paths)
    robots = [robot for batch in batches for robot in batch.robots]
    seat = seat_of(robots[0]) if robots else Seat(1.0)
    tracks, ground = tracks_of(batches, seat)
    find_again(tracks, ground)
    return FleetReview(_figures(batches[0].fleet, tracks, seat), seat, ground, tracks)


def find_again(tracks: Sequence[RobotTrack], ground: Cells) -> None:
    """Find the cells that robots swept after others, and the share of sweeping again in each.

    Args:
        tracks: entered and swept cells of the robots; ``again`` is filled in.
        ground: cells that the robots could reach, int64 (n, 2).
    """
    window = window_of(ground)
    if window is None:
        return
    known = mask_of(ground, window)
    for track in tracks:
        others = [other for other in tracks if other is not track]
        _find_again_of(track, others, known, window)


def _find_again_of(
    track: RobotTrack, others: Sequence[RobotTrack], known: NDArray[np.bool_], window: Window
) -> None:
    steps = [(ms, (row, col)) for ms, row, col in track.entered.tolist()]
    foreign = [
        any(other.swept_ms.get(cell, NEVER_MS) < ms for other in others) for ms, cell in steps
    ]
    seen: set[Place] = set()
    at = 0
    while at < len(steps):
        end = at
        while end < len(steps) and foreign[end]:
            end += 1
        if end > at:
            new = {cell for _, cell in steps[at:end]} & track.swept_ms.keys() - seen
            if new:
                way = [cell for _, cell in steps[max(at - 1, 0) : end + 1]]
                track.again.update(dict.fromkeys(new, _share_again(way, known, window)))
        seen.update(cell for _, cell in steps[at : end + 1])
        at = end + 1


def _share_again(way: Sequence[Place], known: NDArray[np.bool_], window: Window) -> float:
    """Return the share of a way in excess of the shortest way between its ends."""
    taken = sum(abs(a[0] - b[0]) + abs(a[1] - b[1]) for a, b in pairwise(way))
    start, end = ((row - window.row0, col - window.col0) for row, col in (way[0], way[-1]))
    away = distances(known, start)
    inside = 0 <= end[0] < window.rows and 0 <= end[1] < window.cols
    least = int(away[end]) if inside else FAR
    if not taken or least >= taken:
        return 0.0
    return 1.0 - least / taken


def _figures(fleet: str, tracks: Sequence[RobotTrack], seat: Seat) -> FleetFigures:
    cell_m2 = seat.cell_m**2
    robots = [_robot(track, cell_m2) for track in tracks]
    swept = {cell for track in tracks for cell in track.swept_ms}
    through_m2, again_m2 = (
        sum(getattr(robot, name) for robot in robots) for name in ("through_m2", "again_m2")
    )
    swept_m2 = len(swept) * cell_m2
    return FleetFigures(
        fleet=fleet,
        time_scale=tracks[0].clock.scale if tracks else 1.0,
        duration_s=_until_last(tracks),
        makespan_s=_until_last(tracks, AT_WORK),
        busy_balance=_balance([robot.busy_s for robot in robots]),
        swept_balance=_balance([robot.swept_m2 for robot in robots]),
        swept_m2=round(swept_m2, 2),
        through_m2=round(through_m2, 2),
        again_m2=round(again_m2, 2),
        again_share=round(again_m2 / swept_m2, 4) if swept else 0.0,
        waited_s=round(sum(robot.waited_s for robot in robots), 1),
        divisions=max((note.division for track in tracks for note in track.notes), default=0),
        robots=robots,
    )


def _until_last(tracks: Sequence[RobotTrack], states: Collection[str] = ()) -> float:
    """Return the time from the beginning, or the first note in ``states``, to the last note [s].

    Times are by the clock of the robot with the last note.
    """
    at = [(note.at_ms, track) for track in tracks for note in track.notes
          if not states or note.state in states]  # fmt: skip
    if not at:
        return 0.0
    first_ms = min(at_ms for at_ms, _ in at) if states else 0
    last_ms, track = max(at, key=lambda one: one[0])
    return round(float(np.diff(seconds_of(track.clock, [first_ms, last_ms])).item()), 1)


def _balance(values: Sequence[float]) -> float:
    return round(min(values) / max(values), 3) if values and max(values) > 0 else 1.0


def _robot(track: RobotTrack, cell_m2: float) -> FleetRobotFigures:
    notes = track.notes
    times = seconds_of(track.clock, [note.at_ms for note in notes]).tolist()
    longest_s = LONGEST_NOTE_S * track.clock.scale
    lasting = [min(b - a, longest_s) for a, b in pairwise(times)] + [0.0]
    waits: list[float] = []
    was_waiting = False
    for note, seconds in zip(notes, lasting, strict=True):
        if note.waits_for:
            waits = [*waits[:-1], waits[-1] + seconds] if was_waiting else [*waits, seconds]
        was_waiting = bool(note.waits_for)
    busy_s = sum(
        seconds
        for note, seconds in zip(notes, lasting, strict=True)
        if note.state in AT_WORK and not note.waits_for
    )
    recorded_s = max(sum(lasting), 1.0)
    plans = [ms for note in notes for ms in note.plans_ms]
    again = sum(track.again.values())
    return FleetRobotFigures(
        name=track.name,
        state=notes[-1].state if notes else "",
        busy_s=round(busy_s, 1),
        waited_s=round(sum(waits), 1),
        waits=len(waits),
        longest_wait_s=round(max(waits, default=0.0), 1),
        driven_m=round(sum(note.driven_m for note in notes), 1),
        swept_m2=round(len(track.swept_ms) * cell_m2, 2),
        through_m2=round((len(track.again) - again) * cell_m2, 2),
        again_m2=round(again * cell_m2, 2),
        messages_s=round(sum(note.messages for note in notes) / recorded_s, 2),
        kb_s=round(sum(note.bytes for note in notes) / recorded_s / 1000, 2),
        peak_kb_s=_peak_kb_s(notes, times),
        plans=len(plans),
        plan_ms_p50=round(float(np.percentile(plans, 50)), 1) if plans else None,
        plan_ms_p99=round(float(np.percentile(plans, 99)), 1) if plans else None,
    )


def _peak_kb_s(notes: Sequence[Note], times: Sequence[float]) -> float:
    """Return the highest rate of messages over PEAK_S [kB/s], of notes at ``times`` [s]."""
    most, first, total = 0.0, 0, 0
    for note, at_s in zip(notes, times, strict=True):
        total += note.bytes
        while at_s - times[first] > PEAK_S:
            total -= notes[first].bytes
            first += 1
        most = max(most, total)
    return round(most / PEAK_S / 1000, 2)
