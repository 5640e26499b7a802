"""Kernels on floor rasters: places of a robot's disc, sweeping by its tool, the driven line."""
