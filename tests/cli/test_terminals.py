"""Each command in terminals of two kinds: nothing wraps, no escape is shown, Ctrl-C ends it."""

from __future__ import annotations

import lzma
import re
from contextlib import ExitStack
from pathlib import Path

import pytest

from fasaco_edge.cli import COMMANDS
from tests.support.outsider import Outsider
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import begin
from tests.support.terminal import Terminal

ROOT = Path(__file__).parents[2]
# Columns, lines and environment.
TERMINALS = [(80, 24, {"NO_COLOR": "1"}), (60, 20, {"TERM": "dumb"})]
COLOUR = re.compile(r"\x1b\[(?:\d+;)*(?:3[0-8]|4[0-8]|9[0-7])[;m]")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    pytest.importorskip("rerun")
    folder = tmp_path_factory.mktemp("place")
    packed = (ROOT / "tests/data/mission.rrd.xz").read_bytes()
    (folder / "night.rrd").write_bytes(lzma.decompress(packed))
    with daemon_process(folder) as daemon:
        with Outsider(daemon.endpoint) as outsider:
            begin(outsider)
        (folder / "mine.yaml").write_text(f"bus: {{listen: [{daemon.endpoint}]}}")
        (folder / "open.yaml").write_text("bus: {listen: ['tcp/0.0.0.0:7447']}")
        (folder / "other.yaml").write_text(f"bus: {{listen: [{free_endpoint()}]}}")
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            yield daemon.endpoint


# What is run to its end, exit codes, and words that have to be read.
TO_THE_END = [
    ("maps", {0}, "warehouse"),
    ("warmup", {0}, "kernels ready"),
    ("check-config mine.yaml", {0}, "mine.yaml: in order"),
    # By the computer that the tests run on.
    ("check-config open.yaml", {78}, "authentication"),
    ("init wide.yaml --robot-radius 0.2 --tool-width 0.5 --map-by zenoh --force", {0}, "caution:"),
    ("doctor --config mine.yaml", {0, 1}, "the daemon runs: covering"),
    ("plan office --budget 0.1 --long", {0}, "walk recovered cells"),
    ("ask status", {0}, "covering"),
    ("ask path", {0}, "length_m"),
    ("mission status", {0}, "everything reachable"),
    ("rooms list", {0}, "room"),
    ("watch --once", {0}, "COVERING"),
    ("review night.rrd", {0}, "complete: every cell covered"),
    ("review night.rrd --at 0:02", {0}, "robot "),
    ("review night.rrd --against night.rrd", {0}, "Both had the same setup."),
    ("replay night.rrd", {0, 1}, "covering: path"),
    ("bench", {0}, "planners"),
    ("--help", {0}, "check-config"),
]
# What is ended by Ctrl-C once it shows some words, and its exit code: 0 where that is the way to
# end it.
ENDED = [
    ("run --config other.yaml --state other", "ready after", 0),
    ("follow", "looks for other followers", 0),
    ("serve --listen 127.0.0.1:{}", "/ to look only", 0),
    ("record --out .", "records into .; Ctrl-C ends it", 0),
    ("init new.yaml", "Radius of the disc", 130),
    ("bench planners --seeds 1000 --maps basement", "planners ━", 130),
]
# Live pages and bars have tests of their own: test_demo_view.py, test_progress.py, tests/watch.
ELSEWHERE = {"demo", "simulate"}


def test_no_command_is_left_out():
    named = {words.split()[0] for words, *_ in (*TO_THE_END, *ENDED)}
    assert set(COMMANDS) == (named | ELSEWHERE) - {"--help"}


def check_shown(shell, env):
    assert "\\x1b" not in shell.written
    wrapped = [
        line
        for line in shell.shown.wrapped
        # A line of the log stays one line, and a path is not broken, however long it is.
        if not line.startswith(("INFO ", "WARNING ")) and "/" not in line.rsplit(maxsplit=1)[-1]
    ]
    assert wrapped == [], "\n".join(shell.screen())
    # Nor is anything shown as Python has it.
    assert not re.search(r"Traceback|\bNone\b|\{'", shell.written), shell.written
    assert "TERM" not in env or "\x1b" not in shell.written
    assert "NO_COLOR" not in env or not COLOUR.search(shell.written)
    assert shell.is_clean()


@pytest.mark.parametrize(("words", "codes", "said"), TO_THE_END, ids=[row[0] for row in TO_THE_END])
def test_a_command_fits_its_terminal(place, words, codes, said):
    with ExitStack() as stack:
        shells = [
            stack.enter_context(
                Terminal(*words.split(), columns=columns, lines=lines, FASACO_CONNECT=place, **env)
            )
            for columns, lines, env in TERMINALS
        ]
        for shell, (_, _, env) in zip(shells, TERMINALS, strict=True):
            assert shell.end() in codes, shell.written
            check_shown(shell, env)
            assert said in "\n".join(shell.screen()), shell.written


@pytest.mark.parametrize(("words", "said", "code"), ENDED, ids=[row[0] for row in ENDED])
def test_ctrl_c_ends_a_command_in_order(place, words, said, code):
    port = free_endpoint().rpartition(":")[2]
    with Terminal(*words.format(port).split(), FASACO_CONNECT=place) as shell:
        shell.wait_text(said)
        if words.startswith("record"):
            shell.wait(lambda _: any(Path().glob("run*.rrd")))
        shell.type("\x03")
        assert shell.end() == code, shell.written
        check_shown(shell, {})
        if words.startswith("record"):
            assert re.search(r"\n(\^C)?run\d+-\w+-robot-part1\.rrd\n", "\n".join(shell.screen()))
