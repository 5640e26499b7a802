"""The daemon's configuration: typed sections, read and checked as a whole."""
