"""The command ``plan``, part by part."""
