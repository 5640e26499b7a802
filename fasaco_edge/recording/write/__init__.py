"""The recorder: samples from the bus, written to parts of a recording."""
