"""Orders: zones, passes, keep-out zones, and what is to be done next."""
