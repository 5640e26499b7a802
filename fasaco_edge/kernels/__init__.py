"""Compiled inner loops: arrays in, arrays out; the floor that imports numba."""
