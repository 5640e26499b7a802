"""The roll: who is there, by their liveliness tokens.

They are asked for, not subscribed to. A subscriber of Zenoh's (1.10) keeps each key it was ever
told; after a flood it keeps tokens that nobody has; and beside one, an answer may be empty.
"""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Any

import zenoh

# Of a flood of tokens no more are remembered.
MOST_TOKENS = 16_384
# So long an answer may take [s]; one that does not come in time changes nothing.
ANSWER_S = 2.0


class Roll:
    """The tokens that match a key.

    Attributes:
        version: counts the answers; 0 before the first.
    """

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self.version = 0
        self._session = session
        self._key = key
        self._lock = threading.Lock()
        self._there = frozenset[str]()
        self._asked_at = float("-inf")
        self._is_asking = False

    def there(self) -> frozenset[str]:
        """Return the keys of the tokens that stood when that was last answered."""
        return self._there

    def ask(self, period_s: float) -> None:
        """Ask who is there, if that was asked so long ago [s]; the roll follows the answer."""
        now = time.monotonic()
        with self._lock:
            if self._is_asking or now - self._asked_at < period_s:
                return
            self._is_asking, self._asked_at = True, now
        found, wrong = set[str](), list[zenoh.Reply]()

        def take(reply: zenoh.Reply) -> None:
            if reply.ok is None:
                wrong.append(reply)
            elif len(found) < MOST_TOKENS:
                found.add(str(reply.ok.key_expr))

        answered: Any = zenoh.handlers.Callback
        end = answered(take, lambda: self._take(found, is_whole=not wrong), indirect=False)
        with contextlib.suppress(zenoh.ZError):  # a session that ends
            self._session.liveliness().get(self._key, end, timeout=ANSWER_S)

    def _take(self, found: set[str], *, is_whole: bool) -> None:
        with self._lock:
            self._is_asking = False
            # The first counts as it is: to wait for one that is frozen may take for ever.
            if is_whole or not self.version:
                self._there = frozenset(found)
                self.version += 1
