"""Offline planning: maps in files, one walk over each, and the line to be driven, as values."""
