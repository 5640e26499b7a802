"""Orders as people give them: zones, passes, keep-out zones, commands."""
