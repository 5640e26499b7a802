"""Record of a daemon's run: its configuration, its start and its paths, from samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise

import msgspec

from fasaco_edge.bus.arrival import PATH_DIGEST, Arrival
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.errors import BadConfiguration, MalformedMessage
from fasaco_edge.planners.stopping import SearchWork
from fasaco_edge.wire.json_text import decode_tolerant
from fasaco_edge.wire.status import PathAttachment, Settings, Status


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

    config: Settings = field(default_factory=dict)
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
            return msgspec.convert(self.config, DaemonConfig)
        except msgspec.ValidationError as error:
            raise BadConfiguration(
                f"recorded configuration, of release {self.version}: {error}",
                hint="give one of this release with --config",
            ) from error


def read_run(samples: Iterable[Arrival]) -> RecordedRun:
    """Return what samples, in order, tell of the daemon that ran meanwhile."""
    statuses: list[tuple[Arrival, Status]] = []
    paths: dict[int, RecordedPath] = {}
    for arrival in samples:
        with suppress(MalformedMessage):
            if arrival.topic == PATH_DIGEST and (path := _path(arrival)) is not None:
                paths.setdefault(path.revision, path)
            elif arrival.topic == "status":
                statuses.append((arrival, decode_tolerant(arrival.sample.payload, Status)))
    if not statuses:
        return RecordedRun(paths=paths)
    first = statuses[0][1]
    # The mission begins with a map, and keeps it as long as it lives.
    ready = [arrival.at_ns for arrival, status in statuses if status.map is not None]
    begun = [status.map is not None for _, status in statuses]
    return RecordedRun(
        config=first.config,
        version=first.version,
        ready_ns=ready[0] if ready else None,
        restored_cells=first.ledger.restored_cells,
        starts=sum(before and not now for before, now in pairwise(begun)),
        paths=paths,
    )


def _path(arrival: Arrival) -> RecordedPath | None:
    about = decode_tolerant(arrival.sample.attachment, PathAttachment)
    if not about.revision:
        return None
    counts = [count for count in (about.ants, about.kicks, about.proposals) if count is not None]
    return RecordedPath(
        at_ns=arrival.at_ns,
        revision=about.revision,
        reason=about.reason,
        digest=arrival.sample.payload,
        work=SearchWork(*counts) if len(counts) == 3 else None,
    )
