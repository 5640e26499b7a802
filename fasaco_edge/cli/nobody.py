"""What is said where no daemon answers."""

from __future__ import annotations

from collections.abc import Collection

from fasaco_edge.errors import FasacoError
from fasaco_edge.text import one_line


class NobodyAnswersError(FasacoError):
    """No daemon of that robot is on the bus."""

    code = "nobody_answers"

    def __init__(self, prefix: str, robots: Collection[str]) -> None:
        names = one_line(", ".join(sorted(robots)))
        there = f"there are {names}: give one as --robot" if names else "there is none"
        super().__init__(
            f"no daemon answers at {prefix}",
            hint=f"of robots on this bus {there}; `fasaco-edge run` starts a daemon",
        )
