"""Judge of a driven line, by map and line alone: the floor it swept, and its contacts."""
