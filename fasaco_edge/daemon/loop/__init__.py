"""The daemon's loop: take, decode, step, perform."""
