"""Offline planning: a walk over a map in a file or an array, and the line to be driven."""
