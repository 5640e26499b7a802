"""Kernels that grow walks cell by cell: the colony, and the paper's baselines."""
