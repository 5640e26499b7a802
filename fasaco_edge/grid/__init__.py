"""Values of grids: geometry, occupancy grids, the coverage lattice, map files."""
