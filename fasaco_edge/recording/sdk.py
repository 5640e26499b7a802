"""Rerun, or the reason why there is none."""

from __future__ import annotations

from fasaco_edge.errors import MissingExtra

try:
    import rerun as rr
    import rerun.blueprint as rrb
    from rerun.chunk import RrdReader
except ImportError as error:
    raise MissingExtra(f"recordings need rerun, which is not installed: {error}") from error

__all__ = ["RrdReader", "rr", "rrb"]
