"""Makes a folder from which a robot is installed without a network."""
