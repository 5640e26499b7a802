"""Rooms of the building: found on maps, kept with their names, split and merged by people."""
