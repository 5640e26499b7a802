"""Values to pictures: maps, walks and pheromone as PNG."""
