"""What a recording tells of the daemon that ran then: its configuration, its start, its paths."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import msgspec

from fasaco_edge.bus.arrival import PATH_DIGEST, Arrival
from fasaco_edge.daemon.config import DaemonConfig
from fasaco_edge.errors import BadConfiguration, MalformedMessage
from fasaco_edge.planners.work import SearchWork
from fasaco_edge.wire.status import decode_json


@dataclass(frozen=True, slots=True)
class RecordedPath:
    """A path that the daemon published.

    Attributes:
        at_ns: when it came to the recorder, see ``Arrival`` [ns].
        revision, reason: from its attachment.
        digest: of its points.
        work: what was done for the plan; None where no plan was needed.
    """

    at_ns: int
    revision: int
    reason: str
    digest: bytes
    work: SearchWork | None


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """What is known of the run of a daemon; without one, nothing.

    Attributes:
        config: its configuration, as its first status gave it.
        version: its release.
        ready_ns: when its mission had begun, with a map, see ``Arrival``; None if no status tells.
        restored_cells: covered cells that it took over from before; a recording has them not.
        starts: how often a daemon was started after the first.
        paths: what it published, by revision; of a second daemon, not.
    """

    config: Mapping[str, Any] = field(default_factory=dict)
    version: str = ""
    ready_ns: int | None = None
    restored_cells: int = 0
    starts: int = 0
    paths: Mapping[int, RecordedPath] = field(default_factory=dict)

    def daemon_config(self) -> DaemonConfig:
        """Return the configuration.

        Raises:
            BadConfiguration: it is of a release whose settings this one does not know.
        """
        try:
            return msgspec.convert(dict(self.config), DaemonConfig)
        except msgspec.ValidationError as error:
            raise BadConfiguration(
                f"recorded configuration, of release {self.version}: {error}",
                hint="give one of this release with --config",
            ) from error


def read_run(samples: Iterable[Arrival]) -> RecordedRun:
    """Return what samples, in order, tell of the daemon that ran meanwhile."""
    statuses: list[tuple[Arrival, Mapping[str, Any]]] = []
    paths: dict[int, RecordedPath] = {}
    for arrival in samples:
        if arrival.topic == PATH_DIGEST and (path := _path(arrival)) is not None:
            paths.setdefault(path.revision, path)
        elif arrival.topic == "status" and (status := _json(arrival.sample.payload)) is not None:
            statuses.append((arrival, status))
    if not statuses:
        return RecordedRun(paths=paths)
    first = statuses[0][1]
    # The mission begins with a map, and keeps it as long as it lives.
    ready = [arrival.at_ns for arrival, status in statuses if status.get("map") is not None]
    begun = [status.get("map") is not None for _, status in statuses]
    ledger = first.get("ledger")
    return RecordedRun(
        config=_mapping(first.get("config")),
        version=str(first.get("version", "")),
        ready_ns=ready[0] if ready else None,
        restored_cells=_integer(_mapping(ledger).get("restored_cells")) or 0,
        starts=sum(before and not now for before, now in pairwise(begun)),
        paths=paths,
    )


def _path(arrival: Arrival) -> RecordedPath | None:
    about = _json(arrival.sample.attachment)
    revision = _integer(about.get("revision")) if about else None
    if about is None or revision is None:
        return None
    counts = [_integer(about.get(name)) for name in ("ants", "kicks", "proposals")]
    known = [count for count in counts if count is not None]
    return RecordedPath(
        at_ns=arrival.at_ns,
        revision=revision,
        reason=str(about.get("reason", "")),
        digest=arrival.sample.payload,
        work=SearchWork(*known) if len(known) == len(counts) else None,
    )


def _json(payload: bytes) -> Mapping[str, Any] | None:
    try:
        return decode_json(payload)
    except MalformedMessage:
        return None


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _integer(value: object) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) else None
