"""A review: all figures of one recorded mission, from what its recording holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import MapTooLarge
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.mission.orders.zones import kept_out, without
from fasaco_edge.recording import entities
from fasaco_edge.recording.fields import integer, number, section
from fasaco_edge.recording.read.run import RunRecord, Told
from fasaco_edge.review.drive import Drive, WalkFigures, drive_over, first_covered, walk_figures
from fasaco_edge.review.faults import Faults, faults_of
from fasaco_edge.review.moments import Moment, Replans, Span, spans_of, worst_moments
from fasaco_edge.review.orders import OrderChapter, chapters, is_complete, is_still_true
from fasaco_edge.review.story import Story

Entered = tuple[float, str, str]
"""When [s] which state was entered, and why."""


@dataclass(frozen=True, slots=True)
class CoverageCounts:
    """Cells at the end of a recording, and who counted them: "status" or "trail"."""

    covered: int
    coverable: int
    recovered: int | None
    unreachable: int | None
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class Review:
    """All there is to say of a recording; times are [s] since it began.

    Attributes:
        record: its files, plots, states and log.
        story: what its samples tell.
        lattice: over the map at the end; None without a map or a configuration.
        drive, walk: what the robot drove over it.
        first_s: float64 (n,), when each cell was first covered, ascending.
        counts: of cells; None where nobody can tell.
        replans: plans made anew.
        states: of the mission, in order.
        recorder_states: of the recorder.
        moments: the worst ones.
        faults: what was refused and what was lost.
        missing: samples that were lost before they were written.
    """

    record: RunRecord
    story: Story
    lattice: CoverageLattice | None
    drive: Drive | None
    walk: WalkFigures | None
    first_s: NDArray[np.float64]
    counts: CoverageCounts | None
    replans: Replans
    states: tuple[Span, ...]
    recorder_states: tuple[Span, ...]
    moments: tuple[Moment, ...]
    faults: Faults
    missing: int

    @property
    def duration_s(self) -> float:
        """From the first entry of the recording to its last [s]."""
        return _end_s(self.record, self.story)

    @property
    def state(self) -> str:
        """What the mission said last; "" where it said nothing."""
        told = [span.name for span in self.states if span.name != "silent"]
        return told[-1] if told else ""

    @property
    def known_fractions(self) -> NDArray[np.float64]:
        """When [s], and which share of what was known then was covered; float64 (n, 2)."""
        nothing = np.zeros((0, 2))
        return self.record.plots.get(entities.COVERED_FRACTION, nothing)

    @property
    def complete(self) -> bool | None:
        """Whether the last order came to ``done``, nothing missing; None where nobody can tell."""
        if not self.state or (self.state == "done" and self.counts is None):
            return None
        if self.counts is None:
            return False
        last = self.story.statuses[-1] if self.story.statuses else None
        return is_complete(self.state, last, self.counts.covered, self.counts.coverable)

    @property
    def orders(self) -> tuple[OrderChapter, ...]:
        """What was ordered, and what came of each."""
        return chapters(self.story, self.states, self.known_fractions, self.duration_s)


def review_of(record: RunRecord, story: Story, missing: int) -> Review:
    """Return the review of a recording.

    Args:
        record: what was read of it.
        story: what its samples tell.
        missing: how many samples were lost in between.
    """
    end_s = _end_s(record, story)
    lattice = _lattice(story)
    lost_pose_s = number(section(story.config, "mission"), "lost_pose_s") or 0.0
    drive = drive_over(lattice, story.times, story.trail, lost_pose_s) if lattice else None
    states = spans_of(_mission_states(story, record), end_s)
    replans = Replans.of(story.paths)
    fractions = record.plots.get(entities.COVERED_FRACTION, np.zeros((0, 2)))
    return Review(
        record=record,
        story=story,
        lattice=lattice,
        drive=drive,
        walk=walk_figures(drive.cells) if drive else None,
        first_s=first_covered(drive, lattice) if drive and lattice else np.zeros(0),
        counts=_counts(story, drive, fractions),
        replans=replans,
        states=states,
        recorder_states=spans_of(
            _entered(record, entities.RECORDER_STATE, entities.RECORDER_LOG), end_s
        ),
        moments=worst_moments(story, states, replans, fractions),
        faults=faults_of(story, record),
        missing=missing,
    )


def _lattice(story: Story) -> CoverageLattice | None:
    robot, maps = section(story.config, "robot"), section(story.config, "map")
    cell_m, radius_m = number(robot, "tool_width_m"), number(robot, "radius_m")
    if story.grid is None or not cell_m or not radius_m:
        return None
    free, occupied = integer(maps, "free_at_most"), integer(maps, "occupied_at_least")
    usual = Footprint(cell_m, radius_m)
    footprint = Footprint(
        cell_m,
        radius_m,
        usual.free_at_most if free is None else free,
        usual.occupied_at_least if occupied is None else occupied,
    )
    try:
        lattice = CoverageLattice.from_map(story.grid, footprint)
    except MapTooLarge:
        return None
    if not story.keep_out:
        return lattice
    return without(lattice, kept_out(story.keep_out, lattice.window, cell_m, radius_m))


def _end_s(record: RunRecord, story: Story) -> float:
    """Return when the recording ended [s]; samples are written before what is drawn of them."""
    return max(1e-9 * (record.ended_ns - record.began_ns), story.last_s)


def _mission_states(story: Story, record: RunRecord) -> list[Entered]:
    """Return when the mission entered its states, by its statuses and by what was drawn."""
    told = [(status.at_s, status.state, status.reason) for status in story.statuses]
    drawn = _entered(record, entities.MISSION_STATE, entities.MISSION_LOG)
    return sorted((*told, *drawn), key=lambda entry: entry[0])


def _entered(record: RunRecord, entity: str, log: str) -> list[Entered]:
    said = record.log.get(log, ())
    return [
        (1e-9 * (at - record.began_ns), state, _reason(said, at, state))
        for at, state in record.states.get(entity, ())
    ]


def _reason(said: tuple[Told, ...], at_ns: int, state: str) -> str:
    """Return what the log gives as the reason of a state entered just then."""
    prefix = f"{state}: "
    lines = (line for at, line in said if at == at_ns and line.startswith(prefix))
    return next(lines, prefix).removeprefix(prefix)


def _counts(
    story: Story, drive: Drive | None, fractions: NDArray[np.float64]
) -> CoverageCounts | None:
    """Return the daemon's own counts if its last status is still true, else those of the trail."""
    told = [status for status in story.statuses if status.coverage]
    if told and is_still_true(told[-1], fractions):
        coverage = told[-1].coverage
        covered, coverable = integer(coverage, "covered"), integer(coverage, "coverable")
        if covered is not None and coverable is not None:
            recovered, unreachable = (
                integer(coverage, "recovered"),
                integer(coverage, "unreachable"),
            )
            return CoverageCounts(covered, coverable, recovered, unreachable, source="status")
    # What was covered before the recording began, no trail tells.
    if drive is None or any(status.restored_cells for status in story.statuses):
        return None
    cover = drive.coverage
    return CoverageCounts(
        cover.covered, cover.coverable, cover.recovered, cover.unreachable, source="trail"
    )


def seconds_by_state(states: tuple[Span, ...]) -> dict[str, float]:
    """Return how long each state lasted in all [s]."""
    total: dict[str, float] = {}
    for span in states:
        total[span.name] = total.get(span.name, 0.0) + span.seconds
    return total
