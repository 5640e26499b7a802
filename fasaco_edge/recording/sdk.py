"""Rerun, or the reason why it is missing."""

from __future__ import annotations

import os

from fasaco_edge.recording.read.frames import missing_rerun

# Rerun's allocator, mimalloc, keeps 130 MB of freed memory an hour unless this is set at import.
os.environ.setdefault("MIMALLOC_PURGE_DELAY", "0")

try:
    import rerun as rr
    import rerun.blueprint as rrb
except ImportError as error:
    raise missing_rerun(error) from error

__all__ = ["rr", "rrb"]
