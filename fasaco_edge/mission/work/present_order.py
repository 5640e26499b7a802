"""Present order: what the parts of a mission know of the order that is carried out."""

from __future__ import annotations

from dataclasses import dataclass, field

from fasaco_edge.mission.work.exploration import Exploration
from fasaco_edge.mission.work.order_state import NO_ORDER, OrderState


@dataclass(slots=True, eq=False)
class PresentOrder:
    """Owner of the order's state; only the sequencer and its ``PresentPart`` change it.

    Attributes:
        state: the order and its progress.
        exploration: the viewpoints of the present part.
    """

    state: OrderState = field(default_factory=lambda: OrderState.idle(NO_ORDER))
    exploration: Exploration = field(default_factory=Exploration)
