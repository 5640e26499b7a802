"""Mission of a robot of a fleet: the others that share the area, and who sweeps what."""
