"""Takes the viewer out of Rerun's wheel: a robot records, it shows nothing.

The binary ``rerun_cli/rerun`` is more than half of the wheel. Nothing that records or reads
recordings starts it: ``import rerun`` does without, and only ``rerun.spawn()`` misses it. The wheel
stays a proper one, its list of files (RECORD) and its commands included, so that ``pip check`` and
``pip uninstall`` find all as it should be.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

VIEWER = "rerun_cli/rerun"


def without_viewer(wheel: Path) -> None:
    """Write the wheel anew without the viewer's binary and the command that starts it."""
    slim = wheel.with_suffix(".slim")
    with zipfile.ZipFile(wheel) as whole, zipfile.ZipFile(slim, "w", zipfile.ZIP_DEFLATED) as out:
        for member in whole.infolist():
            if member.filename == VIEWER or member.filename.endswith("/entry_points.txt"):
                continue
            content = whole.read(member)
            if member.filename.endswith(".dist-info/RECORD"):
                content = _without_lines(content)
            out.writestr(member, content, zipfile.ZIP_DEFLATED)
    slim.replace(wheel)


def _without_lines(record: bytes) -> bytes:
    lines = record.splitlines(keepends=True)
    return b"".join(
        line
        for line in lines
        if not line.startswith(VIEWER.encode() + b",") and b"/entry_points.txt," not in line
    )
