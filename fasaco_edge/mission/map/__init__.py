"""Map side of a mission: frames, the newest map, the reachable area."""
