"""A process of its own: bus in, .rrd out. The only place that imports rerun."""
