"""Configuration of the recorder that the daemon starts with --record."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from fasaco_edge.daemon.section import Section


class RecordingConfig(Section, frozen=True):
    """How large and how old a file may become, and what all may take.

    A recording goes on in the next file after ``part_mb`` [MB] or ``part_min`` [min], 0 for
    never. Of more than ``quota_mb`` [MB] of this robot's files the oldest are deleted; 0 for
    no limit. Nothing is written while the disk has less than ``least_free_mb`` [MB] free.
    """

    part_mb: Annotated[int, Meta(ge=1, le=100_000)] = 64
    part_min: Annotated[float, Meta(ge=0, le=10_000)] = 10.0
    quota_mb: Annotated[int, Meta(ge=0, le=100_000_000)] = 2000
    least_free_mb: Annotated[int, Meta(ge=0, le=100_000_000)] = 200

    def words(self) -> list[str]:
        """Return these as options of ``fasaco-edge record``."""
        return [
            *("--part-mb", str(self.part_mb)),
            *("--part-min", f"{self.part_min:g}"),
            *("--quota-mb", str(self.quota_mb)),
            *("--least-free-mb", str(self.least_free_mb)),
        ]
