"""Kernels that share a ground among several robots: its blocks, and closed walks over it."""
