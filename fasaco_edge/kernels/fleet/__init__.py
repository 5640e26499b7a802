"""Kernels for several robots on one ground: an estimate of each robot's driving time."""
