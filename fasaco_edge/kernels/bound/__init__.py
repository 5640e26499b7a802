"""Kernels for the lower bound on the number of steps."""
