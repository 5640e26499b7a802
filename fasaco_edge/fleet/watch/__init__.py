"""Live table of a fleet in a terminal: the activity of each robot."""
