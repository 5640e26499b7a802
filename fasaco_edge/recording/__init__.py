"""A process of its own: bus in, .rrd out; the blueprint; reading back. Only here is rerun."""
