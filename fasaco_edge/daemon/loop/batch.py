"""A batch: what arrived since the cycle before, sorted by type as it leaves the mailbox."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from fasaco_edge.bus.mailbox import Mailbox, Spacing
from fasaco_edge.bus.queries import Question
from fasaco_edge.bus.session import Sample
from fasaco_edge.daemon.memory import most_bytes, queues
from fasaco_edge.mission.core.events import PlanBroken, PlanReady

if TYPE_CHECKING:
    from fasaco_edge.planners.planner import ColonySnapshot

# Least time between two maps that are taken [s]: a flood of maps, by mistake or malice, must not
# take a core. No mapper is that fast.
MAP_SPACING_S = 0.05


@dataclass(frozen=True, slots=True)
class Received:
    """A sample, what kind it is (a queue of the mailbox), and when it arrived [s, monotonic]."""

    kind: str
    sample: Sample
    at: float


@dataclass(frozen=True, slots=True)
class Oversized:
    """A sample dropped on arrival: its kind, its size and the limit [bytes]."""

    kind: str
    size: int
    most: int


@dataclass(frozen=True, slots=True, eq=False)
class PlanSnapshot:
    """What plan ``plan`` shows of its search."""

    plan: int
    snapshot: ColonySnapshot


@dataclass(slots=True)
class Batch:
    """What one cycle takes in.

    Attributes:
        samples: in order of arrival for each kind.
        oversized: samples dropped by their size alone.
        questions: commands that wait for an answer.
        plans: results of the planning thread, good or not.
        snapshots: what the planning thread shows of its search.
        updates_lost: map updates that the full queue has dropped.
    """

    samples: list[Received] = field(default_factory=list)
    oversized: list[Oversized] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)
    plans: list[PlanReady | PlanBroken] = field(default_factory=list)
    snapshots: list[PlanSnapshot] = field(default_factory=list)
    updates_lost: int = 0


def take_batch(mailbox: Mailbox[object], timeout_s: float) -> Batch:
    """Wait up to ``timeout_s`` [s] for something to arrive, and take all there is.

    Raises:
        BaseException: what a thread has posted because it failed.
    """
    batch = Batch()
    for _, item in mailbox.take(timeout_s):
        match item:
            case Received():
                batch.samples.append(item)
            case Question():
                batch.questions.append(item)
            case PlanReady() | PlanBroken():
                batch.plans.append(item)
            case PlanSnapshot():
                batch.snapshots.append(item)
            case Oversized():
                batch.oversized.append(item)
            case BaseException():
                raise item
    batch.updates_lost = mailbox.take_lost("map_update")
    return batch


def make_mailbox(max_pixels: int, map_spacing_s: float = MAP_SPACING_S) -> Mailbox[object]:
    """Return the mailbox of a daemon; a replay, whose clock is another, spaces nothing.

    Poses are queued, because each adds to what the tool has passed over; some seconds of them
    are enough. A map does not clear the one before it, because it may be broken. An update
    changes the map before it, so it waits with that map.
    """
    spacing = Spacing("map", map_spacing_s, followers=("map_update",))
    return Mailbox(queues(max_pixels), spacing, _size_of)


def _size_of(item: object) -> int:
    return item.sample.size if isinstance(item, Received) else 0


def poster(mailbox: Mailbox[object], kind: str, max_pixels: int) -> Callable[[Sample], None]:
    """Return what posts samples of a kind, on a Zenoh thread; one too long is dropped."""
    most = most_bytes(kind, max_pixels)

    def post(sample: Sample) -> None:
        if sample.size > most:
            mailbox.post("oversized", Oversized(kind, sample.size, most))
        else:
            mailbox.post(kind, Received(kind, sample, time.monotonic()))

    return post
