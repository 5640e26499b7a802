"""Rooms in an occupancy grid: clearances, furniture, doors, and the regions between them."""
