"""The room that recordings may take, on their disk and in all."""

from __future__ import annotations

import logging
import shutil
from dataclasses import dataclass
from pathlib import Path

from fasaco_edge.recording.quota import Quota

LOG = logging.getLogger(__name__)

# Room beyond the floor before recording goes on: not to fill the disk again at once.
RESUME_BYTES = 1_000_000


@dataclass(frozen=True, slots=True)
class Room:
    """How much a part may take, and how much the disk must keep free [bytes].

    A part older than ``part_s`` [s] is followed by the next, too, 0 for never; ``quota`` limits
    what all take.
    """

    part_bytes: int
    least_free_bytes: int
    part_s: float = 0.0
    quota: Quota | None = None

    def is_full(self, folder: Path) -> bool:
        """Tell whether less is free in ``folder`` than must be."""
        return _free_bytes(folder) < self.least_free_bytes

    def may_begin(self, folder: Path) -> bool:
        """Tell whether there is room enough to go on."""
        return _free_bytes(folder) >= self.least_free_bytes + RESUME_BYTES

    def keep_quota(self, folder: Path) -> None:
        """Delete the oldest parts in ``folder`` where all take more than they may."""
        if self.quota is None:
            return
        try:
            deleted = self.quota.keep(folder, self.part_bytes)
        except OSError as error:
            LOG.warning("recordings above their quota stay: %s", error)
            return
        if deleted:
            LOG.info("deleted for the quota: %s", ", ".join(path.name for path in deleted))


def _free_bytes(folder: Path) -> int:
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        # The folder, or the disk it was on, is gone: no room there until it is back.
        return 0
