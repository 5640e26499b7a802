"""The one place that speaks to Zenoh: sessions, publishers, subscriptions, the mailbox."""
