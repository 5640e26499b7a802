"""What the recorder says about itself on the bus."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RecorderReport:
    """The recorder's status, JSON on the key ``recorder``.

    Attributes:
        state: "recording", "disk full", "stalled" or "stopping".
        reason: why, for a person; may be "".
        file: the part being written; "" while there is none.
        bytes: its size [bytes].
        messages: samples taken from the bus.
        lost: samples that were not written, or may not have been.
        malformed: samples that were not what they should be.
        rss_mb: memory of the process [MB].
        pid: its process id.
    """

    state: str
    reason: str
    file: str
    bytes: int
    messages: int
    lost: int
    malformed: int
    rss_mb: float
    pid: int
