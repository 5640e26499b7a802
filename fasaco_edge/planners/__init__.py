"""Coverage planners: one file per algorithm, one interface, one cost."""
