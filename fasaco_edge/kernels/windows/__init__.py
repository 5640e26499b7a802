"""Kernels that re-optimise windows of a walk, exactly or nearly so."""
