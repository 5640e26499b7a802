"""The recorder, a separate process: bus in, .rrd out; reading back. The only package with Rerun."""
