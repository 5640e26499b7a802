"""Client of one robot: its messages from the bus, its state, and words for people."""
