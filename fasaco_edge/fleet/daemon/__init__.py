"""Messages of a fleet in the daemon: received from other robots, and sent to them."""
