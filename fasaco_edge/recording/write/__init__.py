"""The recorder: samples off the bus into parts of a recording."""
