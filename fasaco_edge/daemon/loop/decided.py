"""What the turn log says of a decision: the same for the mission as it was and once more."""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

from fasaco_edge.kernels.cache import sources_digest
from fasaco_edge.mission.core.events import Decision
from fasaco_edge.wire.turns import Decided

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fasaco_edge.mission.core.mission import Mission


class DecidedNews:
    """Tells turns in which something was decided, or the state has changed, from the others."""

    def __init__(self) -> None:
        self._state = ("", "")

    def of(self, decision: Decision, mission: Mission | None) -> Decided | None:
        """Return what is to be said of the next turn; None for nothing."""
        state = (str(mission.state), mission.reason) if mission else ("", "")
        decided = decided_of(decision, *state)
        is_news = state != self._state or decided != Decided(*state)
        self._state = state
        return decided if is_news else None


def decided_of(decision: Decision, state: str, reason: str) -> Decided:
    """Return what the log says of a decision."""
    plan, path = decision.plan, decision.path
    return Decided(
        state=state,
        reason=reason,
        asked=None if plan is None else (plan.number, plan.reason),
        path=None if path is None else (path.revision, path.reason, cells_checksum(path.cells)),
        faults=[fault.code for fault in decision.faults],
        answers=[
            (answer.number, answer.error.code if answer.error else "")
            for answer in decision.answers
        ],
    )


def cells_checksum(cells: NDArray[np.int32]) -> int:
    """Return the CRC-32 of cells, int32 (n, 2), on any machine."""
    return zlib.crc32(cells.astype("<i4").tobytes())


def kernels_name() -> str:
    """Return the name of the kernels in use, by what they compute."""
    return f"kernels-{sources_digest()}"
