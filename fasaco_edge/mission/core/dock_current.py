"""Dock current: whether the battery of a docked robot is charged, by its level and its messages.

Batteries rise slowly and report in coarse steps, some report the wrong power supply status, and a
bad contact comes and goes: no single message decides.
"""

from __future__ import annotations

from fasaco_edge.mission.core.charging import RISE, BatteryGauge

# A battery that does not report that it charges has to show a rise within this time [s]; any other
# within FLAT_S: at 1 % a step, most charge faster than a step in ten minutes.
PATIENCE_S, FLAT_S = 45.0, 600.0
# A level that falls by more than this is not charged: one step of a coarse gauge is noise.
FALL = 0.0125
CHARGES = ("charging", "full")


class DockCurrent:
    """Follows the battery level of a docked robot; all times are [s]."""

    def __init__(self, gauge: BatteryGauge) -> None:
        self._gauge = gauge
        # Since when the robot is docked, and since when no message says that it charges.
        self._docked_at: float | None = None
        self._unclaimed_at: float | None = None
        # The level where it last turned: the highest while it rises, the lowest while it falls.
        self._turn: float | None = None
        self._falls = False
        self._from = 0.0
        self._rose_at: float | None = None

    @property
    def is_docked(self) -> bool:
        """Whether the robot was docked at the last look."""
        return self._docked_at is not None

    def succeed(self, before: DockCurrent) -> None:
        """Go on with what another one has followed."""
        vars(self).update(vars(before) | {"_gauge": self._gauge})

    def look(self, now: float, *, is_docked: bool) -> None:
        """Note level and power supply at ``now``; to be called in each step."""
        if not is_docked:
            self._docked_at = self._unclaimed_at = self._turn = self._rose_at = None
            self._falls = False
            return
        self._docked_at = now if self._docked_at is None else self._docked_at
        if self._gauge.power in CHARGES:
            self._unclaimed_at = None
        elif self._unclaimed_at is None:
            self._unclaimed_at = now
        if (level := self._gauge.level) is not None:
            self._note_level(level, now)

    def _note_level(self, level: float, now: float) -> None:
        turn = self._turn
        if turn is None:
            self._turn = level
        elif level > turn + (FALL if self._falls else RISE):
            self._turn, self._falls, self._rose_at = level, False, now
        elif self._falls:
            self._turn = min(level, turn)
        elif level < turn - FALL:
            self._turn, self._falls, self._from = level, True, turn

    def why_none(self, now: float) -> str:
        """Return what shows that the battery is not charged; "" if it is, or is not docked."""
        docked_at, level = self._docked_at, self._gauge.level
        if docked_at is None or level is None:
            return ""
        if self._falls:
            return f"its level falls, from {self._from:.0%} to {level:.0%}"
        since = docked_at if self._rose_at is None else self._rose_at
        unclaimed = self._unclaimed_at
        if unclaimed is not None and now - unclaimed >= PATIENCE_S:
            has_risen = self._rose_at is not None and self._rose_at >= unclaimed
            if now - since >= (FLAT_S if has_risen else PATIENCE_S):
                return f"it reports {self._gauge.power!r}, and its level does not rise"
        if now - since >= FLAT_S:
            return f"its level has not risen for {FLAT_S / 60:g} minutes"
        return ""
