"""Kernels for lower bounds: of steps, and of what steps and turns cost."""
