"""Settings for all tests."""

import faulthandler
import os
import signal
from collections.abc import Callable, Iterator
from zlib import crc32

import pytest
from hypothesis import settings

from fasaco_edge.cli.console import terminal
from tests.support.examples import MOST, examples

# What pytest captures is not shown where the process ends at once.
STDERR = os.dup(2)

settings.register_profile("suite", examples(MOST))
settings.load_profile("suite")


def _go_on(*_: object) -> None:
    """Do what a process that ignores the signal does: nothing."""


# Under nohup, or behind `&` in a script, these are ignored, and a started program inherits that.
# What a process catches, its children get in the default way: so this one still goes on, and
# the programs under test start as they do from a terminal.
for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, _go_on)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the files in an order without meaning, the same each time.

    Files of one folder wait for processes, or compute, all alike: mixed, one uses the cores while
    others wait.
    """
    items.sort(key=lambda item: crc32(item.nodeid.partition("::")[0].encode()))


@pytest.fixture
def terminal_width(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int], None]]:
    """Yield what sets the width of the terminal in columns, for one test.

    A console keeps the width that the environment gave when it was made, also for later tests.
    """

    def set_width(columns: int) -> None:
        monkeypatch.setenv("COLUMNS", str(columns))
        for console in (terminal.out, terminal.err):
            console.cache_clear()

    yield set_width
    for console in (terminal.out, terminal.err):
        console.cache_clear()


@pytest.hookimpl(trylast=True)
def pytest_exception_interact(node: pytest.Item | pytest.Collector) -> None:
    """Limit what comes after a failure, too: pytest stops its own watch over hangs there."""
    limit_s = float(node.config.getini("faulthandler_timeout"))
    if limit_s > 0.0 and not node.config.getoption("usepdb"):
        faulthandler.dump_traceback_later(limit_s, file=STDERR, exit=True)


FAILED = pytest.StashKey[bool]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    """Note whether the phase that ended failed."""
    report = yield
    item.stash[FAILED] = report.failed
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    """Tear all fixtures down after a test that failed, not its own alone.

    `make test` repeats it once. Of a recorded mission that a busy machine held up, a fixture of
    the module, it would fail again.
    """
    if item.stash[FAILED]:
        item.session._setupstate.teardown_exact(None)
