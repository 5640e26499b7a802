"""Recording of a whole fleet: one file of all its robots, and the log that reviews read."""
