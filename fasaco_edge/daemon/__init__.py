"""The process around the mission: startup, loop, ledger, reload, service notification."""
