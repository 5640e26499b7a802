"""Recorded missions run again through the daemon's inbox and mission."""
