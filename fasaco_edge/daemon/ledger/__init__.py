"""The coverage ledger on disk."""
