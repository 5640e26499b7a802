"""What is whole of a recording, also of one that a crash tore; the file is never touched."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from fasaco_edge.recording.repair import Scan, scan_recording


@contextmanager
def whole_part(path: Path) -> Iterator[tuple[Path, Scan]]:
    """Yield ``path``, or where its end is torn a copy of what is whole; and what the file holds.

    Raises:
        ValueError: it is no recording.
        OSError: it cannot be read, or there is no room for the copy.
    """
    with path.open("rb") as recording:
        scan = scan_recording(recording)
        if scan is None:
            raise ValueError("this is no recording")
        if scan.has_footer or not scan.torn_bytes:
            yield path, scan
            return
        with TemporaryDirectory() as folder:
            copy = Path(folder, path.name)
            recording.seek(0)
            with copy.open("wb") as target:
                shutil.copyfileobj(recording, target)
                target.truncate(scan.whole_bytes)
            yield copy, scan
