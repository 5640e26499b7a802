"""What all commands share: arguments, terminal, logs, exit codes, signals."""
