"""Claim on a role that only one process may have at a time: planning for a robot, driving its base.

Each process shows a liveliness token that ends with ``<its Zenoh id>/<its state>``: waits, yields,
or a word for the active process. A process that finds another process active waits until that
process is gone. Of the waiting processes, the one with the smallest id becomes active next. If two
are active after a network partition, the process with the smaller id continues. So all agree,
whatever their clocks show. Below, the active process is the daemon that "plans".
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from enum import StrEnum

from fasaco_edge.bus.session import Bus
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.topic_types import Topic

# Time within which two daemons that start together see each other's tokens [s].
SETTLE_S = 0.2
# Period of token queries while one daemon plans [s]; otherwise every cycle.
ASK_PERIOD_S = 1.0
# Time that the others need to reconnect to a restarted router [s].
REJOIN_S = 3.0
# Zenoh's lease: a session silent for this long is gone for the others [s].
LEASE_S = 10.0
# If this process pauses for this long [s], the others may count it as gone: its last message before
# the pause may already be a quarter of a lease old.
PAUSE_S = 0.75 * LEASE_S
# Longest wait for a daemon with a smaller id that does not plan [s]: its lease and a margin.
PATIENCE_S = 15.0

ID = re.compile(r"[0-9a-f]{1,32}")


class ClaimState(StrEnum):
    """State of a daemon's claim; all but the first are chunks of tokens.

    A daemon that ``yields`` has planned before, and waits now: it has published an empty path to
    stop the robot.
    """

    LOOKS = "looks"
    WAITS = "waits"
    YIELDS = "yields"
    PLANS = "plans"

    @property
    def is_waiting(self) -> bool:
        """Whether this daemon waits for another one."""
        return self in (ClaimState.WAITS, ClaimState.YIELDS)


_TOKEN_STATES = (ClaimState.WAITS, ClaimState.YIELDS, ClaimState.PLANS)


class Claim:
    """Decides which daemon of a name plans, from observations and times alone.

    Attributes:
        rejoin_s: time for which an active daemon that lost its connection stays uncertain after it
            has reconnected [s].
        state: state of this daemon.
        rival: id of the daemon that this one waits for, or last waited for; "" for none.
        rival_yielded: whether this daemon plans, and another planning daemon has just yielded.
    """

    rejoin_s = SETTLE_S

    def __init__(self, own: str) -> None:
        self.state = ClaimState.LOOKS
        self.rival = ""
        self.rival_yielded = False
        self._own = own
        self._calm_since: float | None = None
        self._calm_s = SETTLE_S
        self._uncertain_until = float("-inf")
        self._was_in_touch = True
        self._yielding: set[str] = set()
        self._decided_at: float | None = None

    def is_uncertain(self, now: float) -> bool:
        """Return whether another daemon may plan without being visible here: publish nothing then.

        The others may have taken over while this daemon paused or was disconnected.
        """
        return self.state is ClaimState.PLANS and now < self._uncertain_until

    def decide(
        self, others: Mapping[str, ClaimState], now: float, *, in_touch: bool = True
    ) -> None:
        """Update the state from ``others``, the states of the other daemons by id.

        ``now``: time of any monotonic clock [s]. Without ``in_touch`` no other daemon is visible,
        and the state does not change.
        """
        self.rival_yielded = False
        self._notice_absence(now, in_touch=in_touch)
        if not in_touch:
            return
        planning = {one for one, state in others.items() if state is ClaimState.PLANS}
        yielding = {one for one, state in others.items() if state is ClaimState.YIELDS}
        plans = self.state is ClaimState.PLANS
        if planning and (not plans or min(planning) < self._own):
            yields = plans or self.state is ClaimState.YIELDS
            self.state = ClaimState.YIELDS if yields else ClaimState.WAITS
            self.rival, self._calm_since = min(planning), None
        elif plans:
            self.rival_yielded = bool(yielding - self._yielding)
        else:
            self._wait_for_calm(min(others, default=""), now)
        self._yielding = yielding

    def _notice_absence(self, now: float, *, in_touch: bool) -> None:
        """Start a time of uncertainty after a pause, or after the others were not visible."""
        paused_s = 0.0 if self._decided_at is None else now - self._decided_at
        self._decided_at = now
        if paused_s > PAUSE_S or (in_touch and not self._was_in_touch):
            self._calm_since, self._calm_s = None, REJOIN_S
            self._uncertain_until = now + (REJOIN_S if paused_s > PAUSE_S else self.rejoin_s)
        self._was_in_touch = in_touch

    def _wait_for_calm(self, first: str, now: float) -> None:
        """Plan once no other daemon has planned for a while, unless another id is smaller."""
        if self._calm_since is None:
            self._calm_since = now
        is_calm_for_s = now - self._calm_since - self._calm_s
        if is_calm_for_s < 0.0:
            return
        if first and first < self._own and is_calm_for_s < PATIENCE_S:
            self.rival = first
            if self.state is ClaimState.LOOKS:
                self.state = ClaimState.WAITS
        else:
            self.state, self._calm_s = ClaimState.PLANS, SETTLE_S


class BusClaim(Claim):
    """A claim and its token on the bus.

    Args:
        topic: topic of the tokens, whose key has a chunk for the session's id and one for the
            state.
        active: last chunk of the token of a daemon that "plans".

    Attributes:
        is_settled: whether one of the daemons is known to plan.
    """

    def __init__(self, bus: Bus, keys: Keys, topic: Topic, active: str = "plans") -> None:
        super().__init__(bus.id)
        self.is_settled = False
        self._bus, self._keys, self._topic, self._active = bus, keys, topic, active
        self._token_list = bus.token_list(keys.of(topic))
        self._token = bus.token(self.key)
        self._others: dict[str, ClaimState] = {}
        self._version = 0

    @property
    def key(self) -> str:
        """Key of the token for the present state."""
        state = ClaimState.WAITS if self.state is ClaimState.LOOKS else self.state
        shown = self._active if state is ClaimState.PLANS else str(state)
        return self._keys.claim(self._bus.id, shown, self._topic)

    def update(self, now: float) -> bool:
        """Query the others; return whether the state has changed.

        The caller then gives up or takes the role, and calls ``show`` to change the token.
        """
        before = self.state
        in_touch = self._bus.keep_in_touch(now)
        is_settled = self.is_settled and not self.is_uncertain(now)
        self._token_list.ask(ASK_PERIOD_S if is_settled else 0.0)
        if not self._token_list.version:
            return False
        if self._token_list.version != self._version:
            self._version = self._token_list.version
            self._others = claims_in(self._token_list.there(), self._active)
            self._others.pop(self._bus.id, None)
            # While no daemon plans, the tokens are queried every cycle.
            self.is_settled = ClaimState.PLANS in (self.state, *self._others.values())
        self.decide(self._others, now, in_touch=in_touch)
        return self.state is not before

    def show(self) -> None:
        """Show the token of the present state."""
        before, self._token = self._token, self._bus.token(self.key)
        self._bus.withdraw(before)


def claims_in(keys: Iterable[str], active: str = "plans") -> dict[str, ClaimState]:
    """Return the state of each daemon by its id, from the keys of tokens; skip malformed keys."""
    claims: dict[str, ClaimState] = {}
    for key in keys:
        _, own, state = key.rsplit("/", 2)
        state = ClaimState.PLANS if state == active else state
        if ID.fullmatch(own) and state in _TOKEN_STATES:
            # A daemon that changes its state has two tokens for a moment: PLANS takes precedence.
            before = claims.get(own, ClaimState.WAITS)
            claims[own] = max(ClaimState(state), before, key=_TOKEN_STATES.index)
    return claims
