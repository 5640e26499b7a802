"""Each command explains itself."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from fasaco_edge import __version__
from fasaco_edge.cli import COMMANDS, main
from fasaco_edge.cli.console.help import fitted


@pytest.mark.parametrize("name", COMMANDS)
def test_each_help_explains_its_command(capsys, name):
    with pytest.raises(SystemExit, match="0"):
        main([name, "--help"])
    told = capsys.readouterr()
    assert told.err == ""
    assert told.out.startswith(f"usage: fasaco-edge {name}")
    description = told.out.split("\n\n")[1]
    assert len(description) > 30
    # Each option is followed by its explanation, on its line or below.
    options = told.out.partition("positional arguments:")[2] or told.out
    for entry in re.split(r"\n(?=  -)", options)[1:]:
        explained = re.split(r"\s{2,}|\n", entry.strip(), maxsplit=1)
        assert len(explained) == 2, f"not explained: {entry}"


# Commands that have commands of their own.
GROUPS = ("mission start", "mission keep-out", "rooms set", "bench daemon")


@pytest.mark.parametrize("columns", [80, 200])
def test_help_fits_the_terminal(capsys, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    for words in ("", *COMMANDS, *GROUPS):
        with pytest.raises(SystemExit, match="0"):
            main([*words.split(), "--help"])
        for line in capsys.readouterr().out.splitlines():
            # But for a word that is as long itself, and a command.
            words_in_it = line.strip(" []").split()
            is_whole = len(words_in_it) == 1 or words_in_it[:1] == ["fasaco-edge"]
            assert len(line) <= min(columns, 100) or is_whole, f"{words}: {line}"


ROWS = """\
what was written
in two lines:
  run --quick            all that matters, and
                         nothing else
  fasaco-edge plan office --start 1,2 --png line.png | jq 'a b'
  a list item of some words
    that goes on

end
"""


def test_text_is_laid_out_for_a_width():
    assert fitted(ROWS, 70) == ROWS.rstrip("\n")
    assert fitted(ROWS, 32).split("\n") == [
        "what was written",
        "in two lines:",
        "  run --quick",
        "      all that matters, and",
        "      nothing else",
        "  fasaco-edge plan office --start 1,2 --png line.png | jq 'a b'",
        "  a list item of some words",
        "    that goes on",
        "",
        "end",
    ]
    assert fitted("some words of a long sentence\nin prose", 20) == (
        "some words of a long\nsentence in prose"
    )


def test_help_names_every_command(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    told = capsys.readouterr().out
    for name in COMMANDS:
        assert re.search(rf"^    {name}\s+\w", told, re.MULTILINE), name


def test_the_list_of_commands_imports_none_of_them():
    check = (
        "import sys; from fasaco_edge.cli import main\n"
        "try: main(['--help'])\n"
        "finally: assert not {'zenoh', 'numpy', 'rich', 'msgspec'} & set(sys.modules)"
    )
    command = [sys.executable, "-c", check]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.parametrize(
    ("words", "heavy"),
    [
        ("plan --help", "zenoh numba"),
        ("review --help", "numpy numba pyarrow zenoh"),
        ("review nowhere.rrd", "numba pyarrow"),
        ("record --help", "numpy zenoh"),
        ("check-config --help", "zenoh"),
    ],
)
def test_a_command_imports_what_is_heavy_only_where_it_is_used(words, heavy):
    check = (
        "import sys; from fasaco_edge.cli import main\n"
        f"try: main({words.split()})\n"
        "except SystemExit: pass\n"
        f"print('loaded:', *sorted({set(heavy.split())} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", check]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.stdout.splitlines()[-1] == "loaded:", ended.stderr


def test_the_version_is_printed(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out == f"fasaco-edge {__version__}\n"


@pytest.mark.parametrize(("module", "ends"), [("zenoh", False), ("json", True)])
def test_after_a_session_of_zenoh_the_interpreter_does_not_end(module, ends):
    """Threads that a session left behind aborted the process then, now and then."""
    program = (
        f"import atexit, sys, {module}; from fasaco_edge.cli import program\n"
        "atexit.register(print, 'the interpreter ends')\n"
        "sys.argv = ['fasaco-edge', 'maps']; program()"
    )
    command = [sys.executable, "-c", program]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "office" in ended.stdout
    assert ended.stdout.endswith("the interpreter ends\n") == ends
