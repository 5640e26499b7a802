"""Orders: zones, passes, keep-out zones, and what of them is to be done next."""
