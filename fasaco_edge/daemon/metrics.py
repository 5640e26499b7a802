"""Metrics for Prometheus: a table of all metrics of a status, and an HTTP server.

The text format is 0.0.4, in base units. The server has a thread of its own, to which the loop only
passes a reference to the newest status.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from msgspec import UnsetType

from fasaco_edge.host.addresses import Address
from fasaco_edge.host.processes import MB
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.replies import STATES, TROUBLES
from fasaco_edge.wire.documents.status import Status

LOG = logging.getLogger(__name__)

PATH = "/metrics"
# Limit on the bytes of a request; timeout of a connection [s].
MOST_BYTES, LONGEST_S = 8192, 1.0
# Delay of each answer, and time for which all clients get the same answer [s], so that a client in
# a tight loop costs little. Limit on open connections, beyond which the oldest is closed.
PAUSE_S, MOST_OPEN = 0.05, 64
REASONS = {200: "OK", 404: "Not Found", 405: "Method Not Allowed", 503: "Service Unavailable"}

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
PREFIX = "fasaco_edge"

Labels = Mapping[str, str]
LabelledValue = tuple[Labels, float | UnsetType | None]


class Metric(NamedTuple):
    """A metric: name, help text, and its samples from a status.

    Samples without value, None or unset, are left out.
    """

    name: str
    about: str
    samples: Callable[[Status], Iterable[LabelledValue]]
    is_summary: bool = False

    @property
    def kind(self) -> str:
        """Its type; names of counters end in ``_total``."""
        plain = "counter" if self.name.endswith("_total") else "gauge"
        return "summary" if self.is_summary else plain


def _one(value: Callable[[Status], float | None]) -> Callable[[Status], list[LabelledValue]]:
    return lambda status: [({}, value(status))]


def _member(part: str, name: str) -> Callable[[Status], list[LabelledValue]]:
    """Return the sampler of a member of a section of the status; None without that section."""
    return lambda status: [({}, getattr(getattr(status, part), name, None))]


def _times(status: Status) -> list[LabelledValue]:
    loop = status.loop_ms
    shares = (("0.5", loop.p50), ("0.99", loop.p99), ("0.999", loop.p99_9), ("1", loop.max))
    return [({"quantile": share}, _seconds(value)) for share, value in shares]


def _latencies(status: Status) -> list[LabelledValue]:
    last = status.latency_ms
    stages = (("ingest", last.ingest), ("plan", last.plan), ("map_to_path", last.map_to_path))
    return [({"stage": stage}, _seconds(value)) for stage, value in stages]


def _seconds(milliseconds: float | None) -> float | None:
    return None if milliseconds is None else milliseconds / 1000.0


def _troubles(status: Status) -> list[LabelledValue]:
    present = {trouble.code for trouble in status.troubles}
    return [({"code": code}, code in present) for code in TROUBLES]


def _errors(status: Status) -> list[LabelledValue]:
    return [({"code": code}, count) for code, count in sorted(status.errors.by_code.items())]


METRICS = (
    Metric(
        "info",
        "version of the package, and the robot's name",
        lambda status: [({"robot": status.robot, "version": status.version}, 1)],
    ),
    Metric(
        "state",
        "1 for the state of the mission, 0 for the others",
        lambda status: [({"state": name}, name == status.state) for name in STATES],
    ),
    Metric("trouble", "1 for each present trouble, 0 for the others", _troubles),
    Metric("uptime_seconds", "since the daemon began", _one(lambda s: s.uptime_s)),
    Metric("covered_ratio", "covered share of cells", _member("coverage", "fraction")),
    Metric("covered_cells", "cells covered", _member("coverage", "covered")),
    Metric("coverable_cells", "cells within reach", _member("coverage", "coverable")),
    Metric("recovered_cells", "cells covered again", _member("coverage", "recovered")),
    Metric(
        "unreachable_cells",
        "cells where the robot would fit, but that it cannot get to",
        _member("coverage", "unreachable"),
    ),
    Metric("swept_square_metres", "floor swept", _member("floor", "swept_m2")),
    Metric(
        "reachable_square_metres",
        "floor that the tool can reach and is asked to sweep",
        _member("floor", "reachable_m2"),
    ),
    Metric("battery_ratio", "charge of the battery", _member("battery", "level")),
    Metric("path_revision", "counts published paths", _member("path", "revision")),
    Metric("path_remaining_steps", "steps still to drive", _member("path", "remaining_steps")),
    Metric("path_gap_ratio", "cost above the lower bound", _member("path", "gap")),
    Metric("plans_total", "plans made", _member("plan", "plans")),
    Metric(
        "plans_outdated_total",
        "plans that were outdated when they arrived",
        _member("plan", "outdated"),
    ),
    Metric("latency_seconds", "last duration of each stage", _latencies),
    Metric("cycles_total", "cycles of the loop", _member("loop_ms", "turns")),
    Metric("cycles_late_total", "cycles longer than 100 ms", _member("loop_ms", "late")),
    Metric(
        "cycle_seconds", "cycles of the loop since the start, by quantile", _times, is_summary=True
    ),
    Metric("errors_total", "messages refused or not published, and failures", _errors),
    Metric("ledger_age_seconds", "since progress was written", _member("ledger", "age_s")),
    Metric(
        "ledger_faulty",
        "1 where something is or was wrong with the progress on disk",
        _one(lambda status: status.ledger.fault is not None),
    ),
    Metric(
        "recorder_up",
        "1 while the supervised recorder records",
        lambda s: [({}, s.recorder.state == "recording")] if s.recorder else [],
    ),
    Metric("recorder_lost_total", "samples not written", _member("recorder", "lost")),
    Metric("recorder_restarts_total", "restarts of the recorder", _member("recorder", "restarts")),
    Metric("memory_bytes", "of the process", _one(lambda s: s.rss_mb * MB)),
    Metric("processor_seconds_total", "of the process", _one(lambda s: s.cpu_s)),
    Metric("threads", "of the process", _one(lambda s: s.threads)),
)


def exposition(status: Status, age_s: float) -> str:
    """Return all metrics of a status, whose age is ``age_s`` [s]."""
    age = Metric(
        "status_age_seconds",
        "since the daemon's loop made these figures; after some seconds it counts as hung",
        lambda _: [({}, round(age_s, 3))],
    )
    return "".join(line + "\n" for metric in (*METRICS, age) for line in _lines(metric, status))


def _lines(metric: Metric, status: Status) -> Iterator[str]:
    known = [
        (labels, value)
        for labels, value in metric.samples(status)
        if not isinstance(value, UnsetType | None)
    ]
    if not known:
        return
    name = f"{PREFIX}_{metric.name}"
    yield f"# HELP {name} {metric.about}"
    yield f"# TYPE {name} {metric.kind}"
    for labels, value in known:
        within = ",".join(f'{label}="{_escaped(text)}"' for label, text in labels.items())
        number = value if isinstance(value, float) else int(value)
        yield f"{name}{{{within}}} {number!r}" if within else f"{name} {number!r}"


def _escaped(text: str) -> str:
    r"""Return a label's value; unprintable characters are escaped, as ``\x1b``."""
    return one_line(text).replace("\\", "\\\\").replace('"', '\\"')


class MetricsServer:
    """Serves the newest status at an address.

    Raises:
        OSError: it cannot listen there.
    """

    def __init__(self, address: Address) -> None:
        family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        self._socket = socket.create_server(address, family=family, backlog=MOST_OPEN)
        self._shown: tuple[Status, float] | None = None
        # The newest page, and the time until which it is served [s, monotonic].
        self._page, self._page_until = "", 0.0
        # Open connections, the oldest first.
        self._open: list[asyncio.StreamWriter] = []
        self._runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._loop, self._ended = self._runner.get_loop(), asyncio.Event()
        threading.Thread(target=self._run, name="metrics", daemon=True).start()

    def show(self, status: Status) -> None:
        """Serve this status from now on."""
        self._shown = status, time.monotonic()

    def close(self) -> None:
        """Stop listening, and close all connections."""
        self._loop.call_soon_threadsafe(self._ended.set)

    def _run(self) -> None:
        with self._runner:
            self._runner.run(self._serve())

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._attend, sock=self._socket, limit=MOST_BYTES)
        await self._ended.wait()
        server.close()

    async def _attend(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._open.append(writer)
        if len(self._open) > MOST_OPEN:
            self._open.pop(0).transport.abort()
        try:
            async with asyncio.timeout(LONGEST_S):
                head = await reader.readuntil(b"\r\n\r\n")
                await asyncio.sleep(PAUSE_S)
                writer.write(self._answer(head))
                writer.close()
                await writer.wait_closed()
        except (TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, OSError):
            LOG.debug("metrics: a request is too long, or its client gone")
        finally:
            # Bytes that the client does not take are discarded.
            writer.transport.abort()
            with contextlib.suppress(ValueError):
                self._open.remove(writer)

    def _answer(self, request: bytes) -> bytes:
        method, _, rest = request.split(b"\r\n", 1)[0].decode("latin-1").partition(" ")
        code, body = self._content(method, rest.partition(" ")[0].partition("?")[0])
        text = body.encode()
        lines = (
            f"HTTP/1.0 {code} {REASONS[code]}",
            f"Content-Type: {CONTENT_TYPE}",
            f"Content-Length: {len(text)}",
            "Connection: close",
            *(["Allow: GET, HEAD"] if code == 405 else ()),
        )
        head = "\r\n".join((*lines, "", "")).encode()
        return head if method == "HEAD" else head + text

    def _content(self, method: str, path: str) -> tuple[int, str]:
        if method not in ("GET", "HEAD"):
            return 405, "only GET and HEAD\n"
        if path != PATH:
            return 404, f"the figures are at {PATH}\n"
        if self._shown is None:
            return 503, "no status yet\n"
        status, at = self._shown
        if (now := time.monotonic()) >= self._page_until:
            self._page, self._page_until = exposition(status, now - at), now + PAUSE_S
        return 200, self._page


def serve_metrics(address: Address) -> MetricsServer | None:
    """Return a server; None if it cannot listen, as a robot can drive without metrics."""
    try:
        server = MetricsServer(address)
    except OSError as error:
        fault = "metrics.listen: cannot listen on %s port %d, no figures are served: %s"
        LOG.error(fault, *address, error, extra={"event": "metrics"})
        return None
    LOG.info("figures at %s port %d, %s", *address, PATH, extra={"event": "metrics"})
    return server
