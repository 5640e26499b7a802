"""Map side of a mission: frames, the newest map, configured places."""
