"""The claim on a robot's name: of the daemons that have it, one plans.

Each says by a token, ``claim/<its Zenoh id>/<plans, waits or yields>``, that it is there. One
that comes to where another plans waits until that one is gone. Who is first among those that
wait, and who goes on where two find that both plan (they could not see each other), is decided by
their ids alone: both sides come to the same answer, whatever their clocks say.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping
from enum import StrEnum

from fasaco_edge.bus.session import Bus
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.status import ClaimReport

LOG = logging.getLogger(__name__)

# Two that start at the same moment see each other's tokens within this [s].
SETTLE_S = 0.2
# So often it is asked who is there, as long as one plans [s]; else at each turn of the loop.
ASK_PERIOD_S = 1.0
# After a router was away, so long until all others have found it again, too [s].
REJOIN_S = 3.0
# A session that says nothing for this long is taken for dead by the others: Zenoh's lease [s].
LEASE_S = 10.0
# One that could plan and does not is waited for no longer than this [s]: its lease, and some.
PATIENCE_S = 15.0

_ID = re.compile(r"[0-9a-f]{1,32}")


class ClaimState(StrEnum):
    """What a daemon does with its claim; all but the first are chunks of tokens.

    One that ``yields`` waits, and planned before: by its last path the robot was to stand.
    """

    LOOKS = "looks"
    WAITS = "waits"
    YIELDS = "yields"
    PLANS = "plans"


_SHOWN = (ClaimState.WAITS, ClaimState.YIELDS, ClaimState.PLANS)


class Claim:
    """Who of the daemons of one name plans: a pure function of what was seen, and when.

    Attributes:
        stand: what this one does.
        rival: id of the other one that it waits for, or waited for last; "" for none.
        hears_of_yielding: whether this one plans, and another that did so, too, has just yielded.
    """

    def __init__(self, own: str) -> None:
        self.stand = ClaimState.LOOKS
        self.rival = ""
        self.hears_of_yielding = False
        self._own = own
        self._calm_since: float | None = None
        self._calm_s = SETTLE_S
        self._doubts_until = float("-inf")
        self._was_in_touch = True
        self._yielding: set[str] = set()
        self._decided_at: float | None = None

    def doubts(self, now: float) -> bool:
        """Tell whether another may plan by now unseen: nothing should be said until that is known.

        So it is after a pause in which the others may have taken this one for dead.
        """
        return self.stand is ClaimState.PLANS and now < self._doubts_until

    def decide(
        self, others: Mapping[str, ClaimState], now: float, *, in_touch: bool = True
    ) -> None:
        """Take up a stand.

        Args:
            others: the daemons that are there, by id.
            now: time of any steady clock [s].
            in_touch: whether anybody could be seen at all. Where not, all stays as it is.
        """
        self.hears_of_yielding = False
        self._notice_absence(now, in_touch=in_touch)
        if not in_touch:
            return
        planning = {one for one, stand in others.items() if stand is ClaimState.PLANS}
        yielding = {one for one, stand in others.items() if stand is ClaimState.YIELDS}
        plans = self.stand is ClaimState.PLANS
        if planning and (not plans or min(planning) < self._own):
            self.stand = (
                ClaimState.YIELDS if plans or self.stand is ClaimState.YIELDS else ClaimState.WAITS
            )
            self.rival, self._calm_since = min(planning), None
        elif plans:
            self.hears_of_yielding = bool(yielding - self._yielding)
        else:
            self._wait_for_calm(min(others, default=""), now)
        self._yielding = yielding

    def _notice_absence(self, now: float, *, in_touch: bool) -> None:
        """Look anew after a time in which the others could not be seen."""
        paused_s = 0.0 if self._decided_at is None else now - self._decided_at
        self._decided_at = now
        if paused_s > LEASE_S or (in_touch and not self._was_in_touch):
            self._calm_since, self._calm_s = None, REJOIN_S
            self._doubts_until = now + (REJOIN_S if paused_s > LEASE_S else SETTLE_S)
        self._was_in_touch = in_touch

    def _wait_for_calm(self, first: str, now: float) -> None:
        """Plan once nobody has done so for a while, and nobody is before this one."""
        if self._calm_since is None:
            self._calm_since = now
        is_calm_for_s = now - self._calm_since - self._calm_s
        if is_calm_for_s < 0.0:
            return
        if first and first < self._own and is_calm_for_s < PATIENCE_S:
            self.rival = first
            if self.stand is ClaimState.LOOKS:
                self.stand = ClaimState.WAITS
        else:
            self.stand, self._calm_s = ClaimState.PLANS, SETTLE_S


class NameClaim:
    """The claim of this daemon, and its token on the bus."""

    def __init__(self, bus: Bus, keys: Keys) -> None:
        self._bus = bus
        self._keys = keys
        self._claim = Claim(bus.id)
        self._roll = bus.roll(keys.of(topics.CLAIM))
        self._token = bus.token(keys.claim(bus.id, ClaimState.WAITS))
        self._others: dict[str, ClaimState] = {}
        self._version = 0
        self._is_settled = False
        self._stands_back = False

    @property
    def stand(self) -> ClaimState:
        """What this daemon does."""
        return self._claim.stand

    def report(self) -> ClaimReport:
        """Return this part of the status."""
        return ClaimReport(self._bus.id, str(self._claim.stand))

    @property
    def reason(self) -> str:
        """Why it waits."""
        return f"another daemon of this name plans: Zenoh id {self._claim.rival}"

    @property
    def waits(self) -> bool:
        """Whether another daemon is to plan."""
        return self._claim.stand in (ClaimState.WAITS, ClaimState.YIELDS)

    @property
    def hears_of_yielding(self) -> bool:
        """Whether another daemon that planned, too, has just yielded to this one."""
        return self._claim.hears_of_yielding

    def doubts(self, now: float) -> bool:
        """See ``Claim.doubts``."""
        return self._claim.doubts(now)

    def look(self, now: float) -> bool:
        """Look who is there; tell whether this daemon has taken up another stand.

        The token follows with ``show``: once what was said before is taken back.
        """
        before = self._claim.stand
        is_settled = self._is_settled and not self._claim.doubts(now)
        self._roll.ask(ASK_PERIOD_S if is_settled else 0.0)
        if not self._roll.version:
            return False
        if self._roll.version != self._version:
            self._version = self._roll.version
            self._others = claims_in(self._roll.there())
            self._others.pop(self._bus.id, None)
            # Where nobody plans, somebody soon will.
            self._is_settled = ClaimState.PLANS in (self._claim.stand, *self._others.values())
        self._claim.decide(self._others, now, in_touch=self._bus.is_in_touch())
        if self._claim.hears_of_yielding:
            LOG.warning("another daemon of this name planned, too, and has yielded to this one")
        return self._claim.stand is not before

    def show(self) -> None:
        """Let the token say what this daemon does, and tell people once."""
        stand, before = self._claim.stand, self._token
        if self._stands_back is not self.waits:
            self._stands_back = self.waits
            self._bus.let_others_answer(self._stands_back)
        self._token = self._bus.token(self._keys.claim(self._bus.id, stand))
        self._bus.withdraw(before)
        if self._stands_back:
            LOG.warning("%s; this one waits", self.reason, extra={"event": "name_taken"})
        elif self._claim.rival:
            LOG.warning("%s is gone: this daemon plans", self._claim.rival)


def claims_in(keys: Iterable[str]) -> dict[str, ClaimState]:
    """Return the daemons whose tokens these are, by id; what is no claim is left out."""
    claims: dict[str, ClaimState] = {}
    for key in keys:
        _, own, stand = key.rsplit("/", 2)
        if _ID.fullmatch(own) and stand in _SHOWN:
            # Who takes up another stand has two tokens for a moment: to plan comes before all.
            claims[own] = max(
                ClaimState(stand), claims.get(own, ClaimState.WAITS), key=_SHOWN.index
            )
    return claims
