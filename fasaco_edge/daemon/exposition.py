"""Metrics of a status for Prometheus: text format 0.0.4, base units, one table of all metrics."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from msgspec import UnsetType

from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.replies import STATES
from fasaco_edge.wire.documents.status import TROUBLES, Status

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
PREFIX = "fasaco_edge"
MEGABYTE = 1_000_000

Labels = Mapping[str, str]
Sample = tuple[Labels, float | UnsetType | None]


class Figure(NamedTuple):
    """A metric: name, type (gauge, counter or summary), help text, and its samples from a status.

    A sample whose value is None or unset is left out.
    """

    name: str
    kind: str
    about: str
    samples: Callable[[Status], Iterable[Sample]]


def _one(value: Callable[[Status], float | None]) -> Callable[[Status], list[Sample]]:
    return lambda status: [({}, value(status))]


def _member(part: str, name: str, unit: float = 1.0) -> Callable[[Status], list[Sample]]:
    """Return the sampler of a member of a status part that may be null, in base units."""

    def samples(status: Status) -> list[Sample]:
        value = getattr(getattr(status, part), name, None)
        return [({}, value * unit if isinstance(value, int | float) else None)]

    return samples


def _times(status: Status) -> list[Sample]:
    loop = status.loop_ms
    shares = (("0.5", loop.p50), ("0.99", loop.p99), ("0.999", loop.p99_9), ("1", loop.max))
    return [({"quantile": share}, _seconds(value)) for share, value in shares]


def _latencies(status: Status) -> list[Sample]:
    last = status.latency_ms
    stages = (("ingest", last.ingest), ("plan", last.plan), ("map_to_path", last.map_to_path))
    return [({"stage": stage}, _seconds(value)) for stage, value in stages]


def _seconds(milliseconds: float | None) -> float | None:
    return None if milliseconds is None else milliseconds / 1000.0


def _troubles(status: Status) -> list[Sample]:
    present = {trouble.code for trouble in status.troubles}
    return [({"code": code}, code in present) for code in TROUBLES]


def _errors(status: Status) -> list[Sample]:
    return [({"code": code}, count) for code, count in sorted(status.errors.by_code.items())]


FIGURES = (
    Figure(
        "info",
        "gauge",
        "version of the package, and the robot's name",
        lambda status: [({"robot": status.robot, "version": status.version}, 1)],
    ),
    Figure(
        "state",
        "gauge",
        "1 for the state of the mission, 0 for the others",
        lambda status: [({"state": name}, name == status.state) for name in STATES],
    ),
    Figure("trouble", "gauge", "1 for what is wrong in that state, 0 for the others", _troubles),
    Figure("uptime_seconds", "gauge", "since the daemon began", _one(lambda s: s.uptime_s)),
    Figure("covered_ratio", "gauge", "covered share of cells", _member("coverage", "fraction")),
    Figure("covered_cells", "gauge", "cells covered", _member("coverage", "covered")),
    Figure("coverable_cells", "gauge", "cells within reach", _member("coverage", "coverable")),
    Figure("recovered_cells", "gauge", "cells covered again", _member("coverage", "recovered")),
    Figure(
        "unreachable_cells",
        "gauge",
        "cells where the robot would fit, but that it cannot get to",
        _member("coverage", "unreachable"),
    ),
    Figure("swept_square_metres", "gauge", "floor swept", _member("floor", "swept_m2")),
    Figure(
        "reachable_square_metres",
        "gauge",
        "floor that the tool can reach and is asked to sweep",
        _member("floor", "reachable_m2"),
    ),
    Figure("battery_ratio", "gauge", "charge of the battery", _member("battery", "level")),
    Figure("path_revision", "gauge", "counts published paths", _member("path", "revision")),
    Figure("path_remaining_steps", "gauge", "still to drive", _member("path", "remaining_steps")),
    Figure("path_gap_ratio", "gauge", "cost above the lower bound", _member("path", "gap")),
    Figure("plans_total", "counter", "plans made", _member("plan", "plans")),
    Figure(
        "plans_outdated_total",
        "counter",
        "plans that did not hold any more when they came",
        _member("plan", "outdated"),
    ),
    Figure("latency_seconds", "gauge", "how long a stage took last", _latencies),
    Figure("cycles_total", "counter", "cycles of the loop", _member("loop_ms", "turns")),
    Figure("cycles_late_total", "counter", "cycles longer than 100 ms", _member("loop_ms", "late")),
    Figure("cycle_seconds", "summary", "cycles of the loop since the start, by quantile", _times),
    Figure("errors_total", "counter", "refused, not published or failed", _errors),
    Figure("ledger_age_seconds", "gauge", "since progress was written", _member("ledger", "age_s")),
    Figure(
        "ledger_faulty",
        "gauge",
        "1 where something is or was wrong with the progress on disk",
        _one(lambda status: status.ledger.fault is not None),
    ),
    Figure(
        "recorder_up",
        "gauge",
        "1 while the supervised recorder records",
        lambda s: [({}, s.recorder.state == "recording")] if s.recorder else [],
    ),
    Figure("recorder_lost_total", "counter", "samples not written", _member("recorder", "lost")),
    Figure("recorder_restarts_total", "counter", "its restarts", _member("recorder", "restarts")),
    Figure("memory_bytes", "gauge", "of the process", _one(lambda s: s.rss_mb * MEGABYTE)),
    Figure("processor_seconds_total", "counter", "of the process", _one(lambda s: s.cpu_s)),
    Figure("threads", "gauge", "of the process", _one(lambda s: s.threads)),
)


def exposition(status: Status, age_s: float) -> str:
    """Return all metrics of a status of this age [s]."""
    age = Figure(
        "status_age_seconds",
        "gauge",
        "since the daemon's loop made these figures; above some seconds it stands still",
        lambda _: [({}, round(age_s, 3))],
    )
    return "".join(line + "\n" for figure in (*FIGURES, age) for line in _lines(figure, status))


def _lines(figure: Figure, status: Status) -> Iterator[str]:
    known = [
        (labels, value)
        for labels, value in figure.samples(status)
        if not isinstance(value, UnsetType | None)
    ]
    if not known:
        return
    name = f"{PREFIX}_{figure.name}"
    yield f"# HELP {name} {figure.about}"
    yield f"# TYPE {name} {figure.kind}"
    for labels, value in known:
        within = ",".join(f'{label}="{_escaped(text)}"' for label, text in labels.items())
        number = value if isinstance(value, float) else int(value)
        yield f"{name}{{{within}}} {number!r}" if within else f"{name} {number!r}"


def _escaped(text: str) -> str:
    r"""Return a label's value; unprintable characters are escaped, as ``\x1b``."""
    return one_line(text).replace("\\", "\\\\").replace('"', '\\"')
