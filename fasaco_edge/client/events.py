"""Event log of a robot in words: entries, and changes of a status."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.replies import TROUBLES
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.reasons import plain

KEPT = 200
# Tone of an entry.
PLAIN, GOOD, BAD, ORDER = "plain", "good", "bad", "order"
TROUBLED = ("blocked", "degraded")


@dataclass(frozen=True, slots=True)
class Event:
    """An event: its time since the epoch [s], its text and its tone."""

    at_s: float
    text: str
    tone: str = PLAIN


class EventLog:
    """The newest entries, and the number of all entries."""

    def __init__(self) -> None:
        self.entries: deque[Event] = deque(maxlen=KEPT)
        self.count = 0

    def add(self, at_s: float, text: str, tone: str = PLAIN) -> None:
        """Add an event at ``at_s``, time since the epoch [s]."""
        self.entries.append(Event(at_s, one_line(plain(text)), tone))
        self.count += 1

    def since(self, count: int) -> list[Event]:
        """Return the kept entries after the first ``count``."""
        new = min(self.count - count, len(self.entries))
        return list(self.entries)[len(self.entries) - new :]


def differences(before: Status | None, after: Status) -> list[tuple[str, str]]:
    """Return the changes of a status, as (text, tone)."""
    found: list[tuple[str, str]] = []
    if before is None or before.state != after.state:
        tone = BAD if after.state in TROUBLED else GOOD if after.state == "done" else PLAIN
        found.append((f"{after.state}: {after.reason}", tone))
    elif after.state in TROUBLED and before.reason != after.reason:
        found.append((f"{after.state}: {after.reason}", BAD))
    found += _troubles(before, after)
    known = before.errors.by_code if before is not None else {}
    for code, count in after.errors.by_code.items():
        if more := count - known.get(code, 0):
            found.append((f"refused: {more} x {code}, {after.errors.last}", BAD))
    if after.ledger.fault and (before is None or before.ledger.fault != after.ledger.fault):
        found.append((f"ledger: {after.ledger.fault}", BAD))
    recorder = before.recorder.state if before is not None and before.recorder else ""
    if after.recorder and after.recorder.state != recorder:
        tone = PLAIN if after.recorder.state in ("recording", "starting") else BAD
        why = f": {after.recorder.reason}" if after.recorder.reason else ""
        found.append((f"recorder {after.recorder.state}{why}", tone))
    return found


def _troubles(before: Status | None, after: Status) -> Iterator[tuple[str, str]]:
    """Yield the troubles that began and ended, except a trouble that is the mission's reason."""
    known, present = (
        {each.code: each.text for each in (status.troubles if status else ())[: len(TROUBLES)]}
        for status in (before, after)
    )
    for code, text in present.items():
        if code not in known and text != after.reason:
            yield f"trouble: {text}", BAD
    for code in sorted(known.keys() - present.keys()):
        yield f"trouble is over: {code}", GOOD
