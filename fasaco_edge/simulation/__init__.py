"""A robot with a laser scanner that maps a building and follows the path."""
