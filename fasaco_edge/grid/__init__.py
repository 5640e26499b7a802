"""Value types: geometry, occupancy grids, the coverage lattice, map files."""
