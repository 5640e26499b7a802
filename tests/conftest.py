"""Settings for all tests."""

import signal

from hypothesis import settings

# The first example may compile a kernel, or read it from the cache.
settings.register_profile("kernels", deadline=None)
settings.load_profile("kernels")


def _go_on(*_: object) -> None:
    """Do what a process that ignores the signal does: nothing."""


# Under nohup, or behind `&` in a script, these are ignored, and a started program inherits that.
# What a process catches, its children get in the default way: so this one still goes on, and
# the programs under test start as they do from a terminal.
for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, _go_on)
