"""Table of a fleet in a terminal: what each robot does, as it goes."""
