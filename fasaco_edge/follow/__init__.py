"""A program that drives the robot's base along the path: path and pose in, velocities out."""
