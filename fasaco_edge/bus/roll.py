"""The roll: who is there, by their liveliness tokens."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

import zenoh

# So many are remembered. Of a flood of tokens the others are found once it has gone.
MOST_TOKENS = 1024
# So often it is checked, while there is more than one [s]: a flood that goes may leave tokens
# behind which nobody has (Zenoh 1.10 tells what is there and what goes in no certain order).
CHECK_PERIOD_S = 5.0
# So long the answer may take [s].
ANSWER_S = 2.0


class Roll:
    """The tokens that match a key, kept up to date by Zenoh's threads.

    Attributes:
        version: counts the changes.
    """

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self.version = 0
        self._session = session
        self._key = key
        self._lock = threading.Lock()
        self._there: set[str] = set()
        self._overflows = False
        # What came and went since the check under way was asked for; None where there is none.
        self._since: dict[str, bool] | None = None
        self._checked = threading.Event()
        self._check_at = 0.0
        self._subscriber: Any = session.liveliness().declare_subscriber(
            key, zenoh.handlers.Callback(self._note, indirect=False), history=True
        )
        self._check()

    def there(self) -> frozenset[str]:
        """Return the keys of the tokens that stand."""
        with self._lock:
            return frozenset(self._there)

    @property
    def is_whole(self) -> bool:
        """Whether those that were there before it are on it."""
        return self._checked.is_set()

    def check_if_due(self) -> None:
        """Ask who is there, where that is due; the roll follows the answer when it comes."""
        is_idle = len(self._there) < 2 and not self._overflows and self.is_whole
        if not is_idle and time.monotonic() >= self._check_at:
            self._check()

    def release(self) -> None:
        """Let go of what Zenoh has given."""
        del self._subscriber

    def _check(self) -> None:
        with self._lock:
            self._check_at = time.monotonic() + CHECK_PERIOD_S
            self._since = {}
        found, wrong = set[str](), list[object]()

        def take(reply: zenoh.Reply) -> None:
            if reply.ok is None:
                wrong.append(reply)
            elif len(found) <= MOST_TOKENS:
                found.add(str(reply.ok.key_expr))

        asked: Callable[..., Any] = zenoh.handlers.Callback
        end = asked(take, lambda: self._take(found, is_whole=not wrong), indirect=False)
        with contextlib.suppress(zenoh.ZError):
            self._session.liveliness().get(self._key, end, timeout=ANSWER_S)

    def _take(self, found: set[str], *, is_whole: bool) -> None:
        """Take the answer to a check, but what has come and gone meanwhile."""
        with self._lock:
            since, self._since = self._since or {}, None
            if is_whole:
                came = {key for key, here in since.items() if here}
                there = (found | came) - (since.keys() - came)
                self._overflows = len(there) > MOST_TOKENS
                self._there = set(sorted(there)[:MOST_TOKENS])
            self.version += 1
        self._checked.set()

    def _note(self, token: zenoh.Sample) -> None:
        key, here = str(token.key_expr), token.kind == zenoh.SampleKind.PUT
        with self._lock:
            if self._since is not None and len(self._since) < MOST_TOKENS:
                self._since[key] = here
            if not here:
                self._there.discard(key)
            elif len(self._there) < MOST_TOKENS:
                self._there.add(key)
            else:
                self._overflows = True
            self.version += 1
