"""The path follower: path and pose in, velocities for the robot's base out."""
