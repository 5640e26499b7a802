"""Orders: zones, passes, keep-out zones, and the sequence in which they are carried out."""
