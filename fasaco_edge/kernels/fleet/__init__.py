"""Kernels that share one coverage walk out among several robots."""
