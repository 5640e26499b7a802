"""How samples travel: for each key its quality of service; ``protocol/qos.yaml`` is the same table.

Zenoh lets the sender say what becomes of a sample where a link is busy: who publishes a key gets
this from here, whichever process it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Priority = Literal[
    "real_time",
    "interactive_high",
    "interactive_low",
    "data_high",
    "data",
    "data_low",
    "background",
]


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of a key.

    Attributes:
        priority: what goes first where a link is busy.
        reliability: whether a link that may lose what it carries sends it again.
        congestion: ``drop``: a receiver too slow loses the sample; ``block``: the sender waits
            for it.
        express: whether it is sent at once, never gathered with others into one packet.
        cache: how many samples are kept for those who join late; 0 for none.
    """

    priority: Priority = "data"
    reliability: Literal["reliable", "best_effort"] = "reliable"
    congestion: Literal["drop", "block"] = "drop"
    express: bool = False
    cache: int = 0

    @property
    def latched(self) -> bool:
        """Whether who joins late gets what was said last."""
        return self.cache > 0


VOLATILE = Qos()

QOS: dict[str, Qos] = {
    "map": Qos("data_high", cache=1),
    "map_update": Qos("data_high", congestion="block"),
    "pose": Qos("interactive_low", express=True),
    "path": Qos("interactive_high", express=True, cache=1),
    "status": Qos("interactive_low", cache=1),
    "command": Qos("interactive_low"),
    "coverage": Qos("data_low", cache=1),
    "recorder": Qos("data", cache=1),
    "turns": Qos("data_low"),
    "pheromone": Qos("background", "best_effort"),
}
