"""Kernels that improve and repair a complete walk."""
