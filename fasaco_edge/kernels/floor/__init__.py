"""Floor: where a robot's disc may be, what its tool sweeps, and the line that is driven."""
