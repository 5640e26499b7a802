"""Reports of missions in the lab: in words, and as files in a folder."""

from __future__ import annotations

import json
import statistics
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from maps.map_writer import write_map
from tests.campaigns.lab.judge import Figures, judge, truth_of
from tests.campaigns.lab.mission import LabRun
from tests.campaigns.lab.picture import draw

MISSED = 8


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A mission with its figures.

    Attributes:
        run: the mission.
        figures: the judge's.
        missed: the largest patches missed: area [m2], x, y [m].
        wall_s: what it took by the clock [s].
    """

    run: LabRun
    figures: Figures
    missed: list[tuple[float, float, float]]
    wall_s: float

    def document(self) -> dict[str, Any]:
        """Return these as JSON has them; all but ``wall_s`` are the same each time."""
        return {
            "building": self.run.building.name,
            "settings": asdict(self.run.settings),
            "figures": self.figures.document(),
            "missed": self.missed,
            "product": self.run.report.reply,
            "faults": self.run.report.faults,
            "wall_s": round(self.wall_s, 1),
        }


def judged(run: LabRun, wall_s: float, out: Path | None = None) -> Judged:
    """Judge a mission; with a folder write picture, map and figures there."""
    truth = truth_of(run)
    found = Judged(run, judge(run, truth), truth.missed(MISSED), wall_s)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        draw(run, truth, found.figures, out / "picture.png")
        _write(found, out)
    return found


def in_words(found: Judged) -> str:
    """Return the report for people."""
    run, of = found.run, found.figures
    rows = [
        ("ending", f"{of.ending}; the mission is {of.state}: {of.reason}"),
        ("floor", f"{of.true_share:.1%} of {of.reachable_m2:.1f} m2 truly swept, "
                  f"{of.claimed_share:.1%} claimed: {of.excess_points:+.1f} points "
                  f"({of.map_claimed_share:.1%} of what the map shows); of what is not "
                  f"beside a wall {of.clear_share:.1%} swept"),
        ("", f"claimed but not swept {of.claimed_unswept_m2:.2f} m2, swept but not claimed "
             f"{of.swept_unclaimed_m2:.2f} m2; cells {of.coverage:.1%}"),
        ("contacts", f"{of.contacts} separate, {of.contact_s:.1f} s in all; "
                     f"{of.people_touched} with people, {of.driven_into} of them driven into"),
        ("pose error", f"median {of.pose_error_median_m:.3f} m, 95% {of.pose_error_p95_m:.3f}, "
                       f"most {of.pose_error_most_m:.3f}; {of.loops} loops closed"),
        ("driving", f"{of.seconds:.0f} s, {of.driven_m:.0f} m at {of.speed_share:.0%} of the "
                    f"speed; turning {of.turning_share:.0%} of the time, "
                    f"{of.stops_per_m:.2f} stops a metre"),
        ("paths", f"{of.paths_per_min:.1f} a minute, {of.changes_per_min:.1f} change the next 2 m; "
                  f"{of.plans} plans"),
        ("standing", f"at most {of.longest_stand_s:.0f} s with work left"),
        ("missed", ", ".join(f"{m2} m2 at {x}, {y}" for m2, x, y in found.missed) or "nothing"),
        ("took", f"{found.wall_s:.0f} s by the clock; digest {of.digest}"),
    ]  # fmt: skip
    head = f"{run.building.name}, seed {run.settings.seed}"
    return "\n".join([head, *(f"  {name:<11}{text}" for name, text in rows)])


def table(all_found: Sequence[Judged]) -> str:
    """Return a table in Markdown, a row a mission."""
    heads = (
        "building", "seed", "ending", "true %", "clear %", "claimed %", "points", "contacts",
        "pose p95 cm", "s", "speed %", "turning %", "stops/m", "paths/min", "changes/min",
        "stand s", "wall s",
    )  # fmt: skip
    rows = [heads, tuple("---" for _ in heads)]
    for found in all_found:
        of, settings = found.figures, found.run.settings
        rows.append((
            found.run.building.name, str(settings.seed), str(of.ending),
            f"{100 * of.true_share:.1f}", f"{100 * of.clear_share:.1f}",
            f"{100 * of.claimed_share:.1f}",
            f"{of.excess_points:+.1f}", str(of.contacts), f"{100 * of.pose_error_p95_m:.1f}",
            f"{of.seconds:.0f}", f"{100 * of.speed_share:.0f}", f"{100 * of.turning_share:.0f}",
            f"{of.stops_per_m:.2f}", f"{of.paths_per_min:.1f}", f"{of.changes_per_min:.1f}",
            f"{of.longest_stand_s:.0f}", f"{found.wall_s:.0f}",
        ))  # fmt: skip
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([*lines, "", _summary([found.figures for found in all_found])])


def _summary(figures: Sequence[Figures]) -> str:
    """Return how many missions ended how, and their medians."""
    endings = Counter(str(of.ending) for of in figures)
    told = ", ".join(f"{count} {ending}" for ending, count in endings.most_common())
    true, excess = (
        statistics.median(getattr(of, name) for of in figures)
        for name in ("true_share", "excess_points")
    )
    return f"{told}; median of the truly swept share {true:.1%}, of the excess {excess:+.1f} points"


def _write(found: Judged, out: Path) -> None:
    grid = found.run.report.grid
    if grid is not None:
        write_map(grid, out / "map.yaml")
    (out / "figures.json").write_text(json.dumps(found.document(), indent=1), encoding="utf-8")
