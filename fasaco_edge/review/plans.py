"""Plans by the turn log: those, too, that became no path."""

from __future__ import annotations

from dataclasses import dataclass, field

from fasaco_edge.wire.turns import Turn, TurnBatch

# As ``mission.route`` asks for better paths, and names them.
SPARE, BETTER = "spare time", "better further on"


@dataclass(frozen=True, slots=True)
class MadePlan:
    """A plan that was made.

    Attributes:
        at_s: when it came back, since the recording began [s].
        took_ms: how long planning took [ms].
        reason: why it was asked for; "" where that is not recorded.
        is_attempt: whether it was only to make the path better.
        is_used: whether it became a path.
    """

    at_s: float
    took_ms: float
    reason: str
    is_attempt: bool
    is_used: bool


@dataclass(slots=True)
class PlanLog:
    """Puts together what was asked for and what came of it, batch by batch."""

    plans: list[MadePlan] = field(default_factory=list)
    _asked: dict[int, str] = field(default_factory=dict)

    def take(self, batch: TurnBatch, at_s: float) -> None:
        """Take the turns of a batch that came at ``at_s`` [s]."""
        if batch.beginning is not None:
            self._asked = {}  # another daemon numbers from 1 again
        last = batch.times[-1] if batch.times else 0.0
        for turn in batch.turns:
            index = turn.number - batch.first
            ago_s = last - batch.times[index] if 0 <= index < len(batch.times) else 0.0
            self._take(turn, max(at_s - ago_s, 0.0))

    def _take(self, turn: Turn, at_s: float) -> None:
        decided, ready = turn.decided, turn.plan
        if ready is not None:
            reason = self._asked.pop(ready.number, "")
            path = decided.path if decided else None
            became = reason if reason != SPARE else BETTER
            self.plans.append(
                MadePlan(
                    at_s=at_s,
                    took_ms=1e3 * ready.seconds,
                    reason=reason,
                    is_attempt=reason == SPARE,
                    is_used=path is not None and path[1] == became,
                )
            )
        if decided is not None and decided.asked is not None:
            number, reason = decided.asked
            self._asked[number] = reason
