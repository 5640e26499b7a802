"""Observer of a fleet: its robots, their cells and parts, from their messages."""
