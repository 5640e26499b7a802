"""Decoded messages drawn as entities of a recording."""
