"""Documents in JSON: typed, read and written."""
