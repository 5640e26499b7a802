"""The contract in code: keys and codecs, bytes to values and back; no sessions."""
