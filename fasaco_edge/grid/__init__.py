"""Values with meaning: geometry, occupancy grids, the coverage lattice, map files."""
