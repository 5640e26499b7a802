"""Kernels for lower bounds: of steps, and of the cost of steps and turns."""
