"""Common parts of commands: arguments, help, terminal, logs, exit codes."""
