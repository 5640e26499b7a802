"""Replay of recorded missions through the daemon's inbox and mission."""
