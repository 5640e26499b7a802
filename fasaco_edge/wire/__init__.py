"""The contract in code: keys and codecs, bytes to values and back; knows no session."""
