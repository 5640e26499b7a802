"""Messages of a fleet in the daemon: what arrives of other robots, and what this one sends."""
