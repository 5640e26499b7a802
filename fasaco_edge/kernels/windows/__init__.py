"""Kernels that solve windows of a walk anew, exactly or nearly so."""
