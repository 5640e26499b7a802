"""Coverage planners with one interface and one cost: the paper's, and the search of missions."""
