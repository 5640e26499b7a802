"""Recordings (.rrd): the recorder process, and their readers. The only package that uses Rerun."""
