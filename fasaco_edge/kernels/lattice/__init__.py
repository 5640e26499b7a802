"""Kernels on maps and the lattice: which cells are coverable, reachable, changed."""
