"""Messages of a fleet in the daemon: those of other robots, and those of this robot."""
