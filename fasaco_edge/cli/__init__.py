"""The command line: fasaco-edge and its commands, one file each."""
