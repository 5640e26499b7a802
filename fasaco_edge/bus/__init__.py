"""Zenoh bus, the only package that imports Zenoh: sessions, publishers, subscriptions, mailbox."""

from __future__ import annotations

from typing import Final

DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"
"""Endpoint where a daemon listens, and a client connects to, by default."""
