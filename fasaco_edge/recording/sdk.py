"""Rerun, or the reason why there is none."""

from __future__ import annotations

import os

from fasaco_edge.errors import MissingExtra

# Rerun's allocator (mimalloc) kept 130 MB of what was freed in an hour; read once, at its import.
os.environ.setdefault("MIMALLOC_PURGE_DELAY", "0")

try:
    import pyarrow as pa
    import rerun as rr
    import rerun.blueprint as rrb
    from rerun.chunk import RrdReader
except ImportError as error:
    raise MissingExtra(f"recordings need rerun, which is not installed: {error}") from error

# Arrow's own pool keeps what is freed: some ten megabytes of it.
pa.set_memory_pool(pa.system_memory_pool())

__all__ = ["RrdReader", "pa", "rr", "rrb"]
