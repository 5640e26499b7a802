"""Path in force: requests for plans, the published path, and the trail from which ants start."""
