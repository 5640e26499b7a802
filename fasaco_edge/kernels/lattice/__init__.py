"""Kernels on maps and the lattice: coverable, reachable and changed cells."""
