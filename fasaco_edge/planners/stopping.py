"""When a search ends: by the clock, by its work, or because something newer came."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field


@dataclass(slots=True)
class TimeBudget:
    """Stop after some seconds of wall time, counted from the making of this object."""

    seconds: float
    started: float = field(default_factory=time.monotonic)

    def __call__(self, ants: int) -> bool:
        """Tell whether the budget is used up."""
        return time.monotonic() - self.started >= self.seconds


@dataclass(frozen=True, slots=True)
class WorkLimit:
    """Stop after as many ants as an earlier search needed: this repeats its path."""

    ants: int

    def __call__(self, ants: int) -> bool:
        """Tell whether the work is done."""
        return ants >= self.ants


@dataclass(frozen=True, slots=True)
class Interrupt:
    """Stop when another thread asks for it, or at the end of the budget."""

    budget: TimeBudget
    asked: threading.Event = field(default_factory=threading.Event)

    def __call__(self, ants: int) -> bool:
        """Tell whether to stop."""
        return self.asked.is_set() or self.budget(ants)
