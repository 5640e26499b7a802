"""Recorded missions run again through the same inbox and mission."""
