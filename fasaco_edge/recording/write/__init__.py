"""The recorder, which writes samples from the bus to the parts of a recording."""
