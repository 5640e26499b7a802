"""Arrow, a dependency of Rerun, or the reason why it is missing.

Readers of recordings import it alone: importing Rerun costs 0.3 s of processor time.
"""

from __future__ import annotations

from fasaco_edge.errors import MissingExtra


def missing_rerun(error: ImportError) -> MissingExtra:
    """Return the error of an installation without recordings."""
    return MissingExtra(f"recordings need rerun, which is not installed: {error}")


try:
    import pyarrow as pa
except ImportError as error:
    raise missing_rerun(error) from error

# Arrow's own pool keeps about ten megabytes of freed memory.
pa.set_memory_pool(pa.system_memory_pool())

__all__ = ["missing_rerun", "pa"]
