"""Coverage planners behind one interface, at one cost: the paper's, and the search of missions."""
