"""Kernels that divide one coverage walk among several robots."""
