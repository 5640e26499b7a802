"""Turn log documents: what each cycle of the daemon's loop received and decided, as JSON.

With the samples it names, a replay repeats a mission bit for bit. The members are named by the
contract, where a cycle is a turn and an embedded sample is ``told``. Numbers are the JSON numbers
of float64, which come back as they were; bytes are base64.
"""

from __future__ import annotations

import msgspec

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.documents.settings import Settings


class LogStart(msgspec.Struct, frozen=True):
    """The state a daemon started with.

    Attributes:
        version: its release.
        config: the configuration in force, without secrets.
        ledger: the ledger that was restored, as its file holds it; empty for none.
    """

    version: str
    config: Settings
    ledger: bytes = b""


class EarlySample(msgspec.Struct, frozen=True):
    """A sample from before the recorder listened: its key, type and deflated payload."""

    key: str
    schema: str
    deflated: bytes


class TakenSample(msgspec.Struct, frozen=True, array_like=True):
    """A sample that was taken.

    Attributes:
        topic: what it is.
        checksum: CRC-32 of its payload; 0 where the batch itself holds the sample.
        at: when it came, of maps and their updates [s]; 0 of others, where it decides nothing.
        told: the sample itself, from before the recorder listened; None of others.
    """

    topic: str
    checksum: int
    at: float = 0.0
    told: EarlySample | None = None


class PlanTaken(msgspec.Struct, frozen=True, array_like=True):
    """A plan that came back.

    Attributes:
        number: of the request.
        seconds: how long it took.
        stops: which of the planner's questions whether to stop were answered by yes, from 1.
            These repeat it: a repair and the search after it may each have been stopped.
        work: its ants, kicks and proposals.
        checksum: CRC-32 of its cells, int32 (row, col), little endian.
    """

    number: int
    seconds: float
    stops: list[int]
    work: tuple[int, int, int]
    checksum: int


class Decided(msgspec.Struct, frozen=True, omit_defaults=True):
    """What was decided, where anything was or the state has changed.

    Attributes:
        state, reason: of the mission.
        asked: number of the plan asked for, and why; None for none.
        path: revision of the path published, why, and the CRC-32 of its cells; None for none.
        faults: codes of what was refused.
        answers: to commands: their number, and "" or the code of what was wrong.
    """

    state: str
    reason: str
    asked: tuple[int, str] | None = None
    path: tuple[int, str, int] | None = None
    faults: list[str] = []
    answers: list[tuple[int, str]] = []


class Cycle(msgspec.Struct, frozen=True, omit_defaults=True):
    """A cycle in which something came in or was decided.

    Attributes:
        number: of the cycle.
        is_begun: whether there is a mission; what comes before is held for it.
        samples: in the order they were taken in.
        patches_lost: map updates that were lost before them.
        commands: number and document of each.
        plan: that came back.
        decided: what was decided.
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
        first: number of the first one, from 1.
        times: when each was, by the daemon's steady clock [s].
        turns: those cycles in which something came in or was decided.
        beginning: in the first batch alone.
        told: poses and small maps received in these cycles, in order, as ``samples`` encodes
            them: on a busy link a recorder may miss some.
        kernels: names the compiled kernels; in the first batch with a mission alone.
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
        MalformedMessage: it is none.
    """
    try:
        return msgspec.json.decode(payload, type=TurnBatch)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MalformedMessage(f"turn log: {error}") from error
