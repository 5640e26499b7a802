"""The only package that imports Zenoh: sessions, publishers, subscriptions, the mailbox."""

from __future__ import annotations

from typing import Final

DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"
"""Where a daemon listens, and a client connects to, by default."""
