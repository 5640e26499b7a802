"""Exit codes of commands."""

OK = 0
ERROR = 1
CONFIG = 78  # EX_CONFIG of sysexits.h: a service must not be started again
INTERRUPTED = 130  # 128 + SIGINT, as a shell tells it
