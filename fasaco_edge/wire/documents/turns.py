"""Turn log documents: inputs and decisions of each cycle of the daemon's loop, as JSON.

With the samples it names, a replay repeats a mission bit for bit. Member names are the contract's:
``turn`` is a cycle, ``told`` a sample embedded in the log. Numbers are float64, written so that
they are read back exactly; bytes are base64.
"""

from __future__ import annotations

import msgspec

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.documents.json_text import Settings


class LogStart(msgspec.Struct, frozen=True):
    """The state a daemon started with.

    Attributes:
        version: its release.
        config: the configuration in force, without secrets.
        ledger: the bytes of the restored ledger's file; empty for none.
        rooms: the bytes of the file of rooms; empty for none.
    """

    version: str
    config: Settings
    ledger: bytes = b""
    rooms: bytes = b""


class EarlySample(msgspec.Struct, frozen=True):
    """A sample from before the recorder listened: its key, type and deflated payload."""

    key: str
    schema: str
    deflated: bytes


class TakenSample(msgspec.Struct, frozen=True, array_like=True):
    """A sample that a cycle took.

    Attributes:
        topic: its topic.
        checksum: CRC-32 of its payload; 0 if the batch itself holds the sample.
        at: time of arrival of a map or an update [s]; 0 for others, whose time has no effect.
        told: the sample itself, if it arrived before the recorder subscribed; else None.
    """

    topic: str
    checksum: int
    at: float = 0.0
    told: EarlySample | None = None


class PlanTaken(msgspec.Struct, frozen=True, array_like=True):
    """A finished plan.

    Attributes:
        number: number of the request.
        seconds: how long it took.
        stops: numbers, from 1, of the stop checks at which the planner was stopped; a replay stops
            at the same checks. A repair and the search after it may each have been stopped.
        work: its ants, kicks and proposals.
        checksum: CRC-32 of its cells, int32 (row, col), little endian.
    """

    number: int
    seconds: float
    stops: list[int]
    work: tuple[int, int, int]
    checksum: int


class Decided(msgspec.Struct, frozen=True, omit_defaults=True):
    """Decisions of a cycle that decided something or changed the state.

    Attributes:
        state, reason: state and reason of the mission.
        asked: number of the requested plan, and why; None for none.
        path: revision of the published path, why, and the CRC-32 of its cells; None for none.
        faults: codes of refused inputs.
        answers: replies to commands: their number, and "" or an error code.
    """

    state: str
    reason: str
    asked: tuple[int, str] | None = None
    path: tuple[int, str, int] | None = None
    faults: list[str] = []
    answers: list[tuple[int, str]] = []


class Cycle(msgspec.Struct, frozen=True, omit_defaults=True):
    """A cycle with any input or decision.

    Attributes:
        number: number of the cycle.
        is_begun: whether there is a mission; earlier events are held for it.
        samples: the samples, in the order in which the cycle took them.
        patches_lost: number of map updates that were lost before these samples.
        commands: number and document of each.
        plan: the finished plan.
        decided: the decisions.
    """

    number: int
    is_begun: bool = True
    samples: list[TakenSample] = []
    patches_lost: int = 0
    commands: list[tuple[int, dict[str, object]]] = []
    plan: PlanTaken | None = None
    decided: Decided | None = None


class TurnBatch(msgspec.Struct, frozen=True, omit_defaults=True):
    """Consecutive cycles.

    Attributes:
        first: number of the first cycle, from 1.
        times: time of each, by the daemon's monotonic clock [s].
        turns: cycles with any input or decision.
        beginning: the state at the start; only in the first batch.
        told: poses and small maps received in these cycles, in order, encoded as in ``samples``: on
            a busy link a recorder may miss some of them.
        kernels: name of the compiled kernels; only in the first batch with a mission.
    """

    first: int
    times: list[float]
    turns: list[Cycle]
    beginning: LogStart | None = None
    told: bytes = b""
    kernels: str = ""


def decode_turns(payload: bytes) -> TurnBatch:
    """Return the batch in JSON.

    Raises:
        MalformedMessage: the payload is not a batch.
    """
    try:
        return msgspec.json.decode(payload, type=TurnBatch)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MalformedMessage(f"turn log: {error}") from error
