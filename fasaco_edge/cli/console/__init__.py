"""Common parts of commands: arguments, terminal, logs, exit codes, signals."""
