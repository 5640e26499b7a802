"""Fleet side of a mission: the other robots that share the area, and who sweeps what."""
