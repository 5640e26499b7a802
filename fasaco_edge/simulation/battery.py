"""The simulated robot's battery, with given times of charging and of driving."""

from __future__ import annotations

from dataclasses import dataclass

# Discharge while standing, as a share of driving; rate of charging, as a multiple of driving.
STANDING, CHARGING = 0.2, 4.0


@dataclass(slots=True)
class Battery:
    """A battery that lasts ``minutes`` [min] of driving.

    Attributes:
        level: its charge, from 0 to 1.
        is_charging: whether it was in its dock, standing, at the last tick.
        lowest: the least charge so far.
        charges: how often charging began.
    """

    minutes: float
    level: float = 1.0
    is_charging: bool = False
    lowest: float = 1.0
    charges: int = 0

    def tick(self, seconds: float, *, moves: bool, is_docked: bool) -> None:
        """Let some time pass [s]."""
        drain = seconds / (60.0 * self.minutes)
        was_charging, self.is_charging = self.is_charging, is_docked and not moves
        if not self.is_charging:
            drain *= 1.0 if moves else STANDING
        else:
            drain *= -CHARGING
            # In passing, or before it sets out, charging is negligible.
            self.charges += not was_charging and self.level < 0.5
        self.level = min(max(self.level - drain, 0.0), 1.0)
        self.lowest = min(self.lowest, self.level)
