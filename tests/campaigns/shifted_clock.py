"""A wall clock of one's own for real processes, which can be set while they run."""

from __future__ import annotations

import shutil
import struct
import subprocess
import time
from pathlib import Path

SOURCE = Path(__file__).with_suffix(".c")


def why_not() -> str:
    """Return why there can be no such clock here, "" if there can."""
    return "" if shutil.which("gcc") else "gcc is not installed"


class ShiftedClock:
    """The machine's clock and a shift; processes that are given ``environment`` go by it.

    Attributes:
        environment: what makes a process go by this clock, and all that it starts.
    """

    def __init__(self, folder: Path) -> None:
        library, self._file = folder / "shifted_clock.so", folder / "shift"
        words = ["gcc", "-O2", "-shared", "-fPIC", "-o", str(library), str(SOURCE)]
        subprocess.run(words, check=True, capture_output=True)
        self.environment = {"LD_PRELOAD": str(library), "SHIFTED_CLOCK": str(self._file)}
        self.shift(0.0)

    def shift(self, seconds: float) -> None:
        """Set the clock to what the machine's says and so many seconds."""
        with self._file.open("r+b" if self._file.exists() else "wb") as file:
            file.write(struct.pack("=q", round(seconds * 1e9)))

    @staticmethod
    def to(epoch_s: float) -> float:
        """Return the shift by which it is so many seconds after 1970 now."""
        return epoch_s - time.time()
