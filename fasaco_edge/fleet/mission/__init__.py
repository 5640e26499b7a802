"""Mission of a robot of a fleet: the other robots, and which robot sweeps which cell."""
