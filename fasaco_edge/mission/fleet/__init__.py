"""Several robots that share an area: what is heard of the others, and who sweeps what."""
