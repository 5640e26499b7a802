"""The pages for owner, integrator and researcher, followed: all that is not marked is run."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest
import yaml

from fasaco_edge.config.loading import load_config
from fasaco_edge.host.addresses import free_port
from fasaco_edge.offline import settings
from fasaco_edge.review.review import read_review
from tests.support.forked import ENVIRONMENT, Forked, run_forked
from tests.support.reviews import document
from tests.support.waiting import until
from tests.test_guides import ROOT, words_of

OWNER, INTEGRATOR, RESEARCHER = (
    *("deploy/owner.md", "deploy/integrator.md"),
    "fasaco_edge/researcher.md",
)
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.M | re.S)
MARK = "# not run by the tests: "
# Commands that go on until they are ended; `fasaco-edge review` reads what `run` has recorded.
LASTING = ("run", "simulate", "follow", "serve", "watch")
# What these say before anybody ends them; a simulated robot nothing, its daemon that it has a map.
BEGUN = {"run": "(planning|covering|paused): ", "simulate": ""}
# What makes a command quicker, or keeps it apart from other tests.
BESIDE = {
    "bench": "--maps office --seeds 1 --ants 64 --budget 0.5",
    "follow": "--speed 8",
    "init": "--listen 0.2",
    "plan": "--budget 0.5",
    "run": "--state state",
    "serve": "--listen 127.0.0.1:8465",
    "simulate": "--speed 8",
    "tests.benchmarks": "--seeds 1 --ants 32",
}
# What commands show in the end; those that ask a daemon are repeated until they do.
SHOWS = {
    "ask status": r'"state": ?"recording"',
    "ask path": r"length_m +│ [1-9]",
    "bench": r"colony-search",
    "mission status": r"covered +│ .*: ([2-9]|\d\d+) of",
    "replay": r"equal bit for bit",
    "review": r"swept +\d+\.\d of|│ at |difference",
}
REPEATED = ("ask", "mission")
# Ends with 1 for each fault of this computer, such as a clock that is not set.
MAY_END_WITH_1 = ("doctor",)
# What the Python of a page prints, by words in it.
SAYS = {
    "office.png": r"9\d\.\d% of the floor, \d+ points, \d+ s\n",
    "line.csv": "",
    "passes.png": r"edge .*\nauto .*\ncross .*\n<PassPlans flat.yaml, .*>\n",
    "free[5:12, 8:14]": r"fasaco .*\naco .*\nspiral-stc .*\nzigzag .*\n",
    "budget_s in (": r"(\{.*'gap'.*\}\n){3}",
    "from mine import": r"mine\.py:depth_first 666 333 \d+\n\(\d+, \d+\) 667 cells\n",
    "observe=fields.append": r"(\d \d+ \d\.\d+ at \(-?\d+\.\d+, -?\d+\.\d+\) m\n){8}",
    "pheromone.csv": r"\d+ fields; the last has \d+ cells,\nthe strongest at \(.*\) m\n"
    r"from 0\.\d+ to \d\.\d+\n",
    "end.npz": r"monday( .*)\ntuesday\1\n",
}
# Nothing takes so long but on a machine that is busy with much else [s].
TIMEOUT_S = 600.0


class Reader:
    """Follows a page in a folder of its own: writes its files, runs its blocks.

    Attributes:
        said: what the last of each command has printed, by its name.
        ran: how many commands it has run.
        instead: what is typed in place of a page's words.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.said: dict[str, str] = {}
        self.ran = 0
        self._lasting: list[tuple[str, Forked, list[Path]]] = []
        self.instead = {port: str(free_port()) for port in ("7447", "8465")}
        self._environment = ENVIRONMENT | {"FASACO_CONNECT": self._here("tcp/127.0.0.1:7447")}

    def _here(self, text: str) -> str:
        for word, other in self.instead.items():
            text = text.replace(word, other)
        return text

    def follow(self, text: str) -> None:
        """Run all blocks of a page, in order, and end what goes on."""
        try:
            for indent, kind, block in BLOCK.findall(text):
                self._take(kind, dedent(indent + block))
            self._end()
        finally:
            for _, process, _ in self._lasting:
                process.kill()

    def _take(self, kind: str, block: str) -> None:
        if kind in ("", "sh"):
            for line in block.replace("\\\n", " ").splitlines():
                self._run(line)
        elif kind == "yaml":
            file = self.folder / (_name_of(block) or "block.yaml")
            file.write_text(block)
            load_config(file)
            self._listen_here(file)
        elif kind == "python":
            self._run_python(block)
        else:
            pytest.fail(f"a block of {kind}")

    def _run(self, line: str) -> None:
        if MARK in line or not words_of(line):
            return
        program, *words = shlex.split(self._here(shlex.join(words_of(line))))
        name = words[1] if program == "python" else words[0]
        if program == "make":
            # The tests are run by one of them, and tests/cli/test_demo.py runs what the other does.
            recipe = subprocess.check_output(["make", "-n", name], cwd=ROOT, text=True)
            assert re.search(r"fasaco-edge demo|pytest -n", recipe), line
            return
        assert program in ("fasaco-edge", "python"), f"neither run nor marked: {line}"
        if name == "review":
            self._end("run")
        words += shlex.split(self._here(BESIDE.get(name, "")))
        words = [found for word in words for found in self._files(word)]
        words = words if program == "python" else ["-m", "fasaco_edge", *words]
        if name in LASTING and "--once" not in words:
            self._begin(name, words)
        else:
            until(lambda: self._succeeds(name, words), TIMEOUT_S, why=lambda: self.said[name])
        if name == "init":
            self._listen_here(self.folder / words[3])
        self.ran += 1

    def _files(self, word: str) -> list[str]:
        return sorted(map(str, self.folder.glob(word))) if "*" in word else [word]

    def _succeeds(self, name: str, words: list[str]) -> bool:
        """Run a command; one that asks a daemon which has only begun is repeated."""
        code, out, err = run_forked(tuple(words), self._environment, TIMEOUT_S, str(self.folder))
        self.said[name] = out + err
        assert "Traceback" not in err, err
        is_right = code == 0 or (code == 1 and name in MAY_END_WITH_1)
        shows = [said for typed, said in SHOWS.items() if " ".join(words[2:]).startswith(typed)]
        is_right = is_right and all(re.search(said, out) for said in shows)
        assert is_right or name in REPEATED, f"{words}: {code}\n{out}{err}"
        return is_right

    def _begin(self, name: str, words: list[str]) -> None:
        """Begin what goes on; it ends the one of that name before, a new daemon all."""
        self._end(*(LASTING if name == "run" else (name,)))
        files = [self.folder / f"{name}{self.ran}.{kind}" for kind in ("out", "err")]
        for file in files:
            file.touch()
        process = Forked(tuple(words), self._environment, *files, str(self.folder))
        if name == "run":
            self._wait_for("ready", files[1])
        if "--record" in words:
            asked = ["-m", "fasaco_edge", "ask", "status", "--json"]
            until(lambda: self._succeeds("ask", asked), TIMEOUT_S)
        self._lasting.append((name, process, files))

    def _end(self, *names: str) -> None:
        """End what goes on, as Ctrl-C does once there is something to see."""
        for name, process, files in self._lasting[:]:
            if name in (names or LASTING):
                self._wait_for(BEGUN.get(name, "."), *files)
                assert process.poll() is None, f"{name} has ended by itself: {process.returncode}"
                process.send_signal(signal.SIGINT)
                assert process.wait(TIMEOUT_S) in (0, 130), name
                self._lasting.remove((name, process, files))

    def _wait_for(self, words: str, *files: Path) -> None:
        """Wait until one of the files holds words, a regular expression."""
        until(
            lambda: any(re.search(words, file.read_text()) for file in files),
            TIMEOUT_S,
            why=lambda: [file.name for file in files],
        )

    def _listen_here(self, file: Path) -> None:
        config = yaml.safe_load(file.read_text())
        config.setdefault("bus", {"listen": [self._here("tcp/127.0.0.1:7447")]})
        file.write_text(yaml.safe_dump(config))

    def _run_python(self, block: str) -> None:
        if name := _name_of(block):
            (self.folder / name).write_text(block)
            return
        (expected,) = [regex for words, regex in SAYS.items() if words in block]
        said = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(said):
            exec(compile(block, "example", "exec"), {})
        assert re.fullmatch(expected, said.getvalue()), said.getvalue()


def _name_of(block: str) -> str:
    """Return the name of the file that a block is, "" for none."""
    named = re.match(r"# (\w+\.\w+)\n", block)
    return named[1] if named else ""


def page(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def integrated(tmp_path_factory):
    """What an integrator has at the end of the page, a recording with it."""
    pytest.importorskip("rerun")
    reader = Reader(tmp_path_factory.mktemp("integrator"))
    reader.follow(page(INTEGRATOR))
    return reader


def test_an_integrator_s_page(integrated):
    assert integrated.ran >= 15


def test_a_researcher_s_page(integrated, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    monkeypatch.setattr(settings, "BUDGET_S", 0.1)
    (recording,) = integrated.folder.glob("recordings/*.rrd")
    for night in ("monday", "tuesday"):
        (tmp_path / f"{night}.rrd").write_bytes(recording.read_bytes())
    reader = Reader(tmp_path)
    # The robot has not driven for a minute, but on a busy machine.
    last_s = document(read_review([recording]))["duration_s"] - 0.2
    if last_s < 60.0:
        reader.instead["--at 1:00"] = f"--at 0:{last_s:04.1f}"
    reader.follow(page(RESEARCHER))
    assert "mine.py:depth_first" in reader.said["bench"]
    names = ("office", "mine", "field", "passes", "then", "both")
    assert all((tmp_path / f"{name}.png").is_file() for name in names)


@pytest.mark.parametrize("name", ["README.md", OWNER])
def test_commands_of_the_other_pages_work(name, tmp_path):
    Reader(tmp_path).follow(page(name))


@pytest.mark.parametrize("line", ["scp a b", "fasaco-edge ledger", "sudo apt install x"])
def test_a_command_is_run_or_marked(line, tmp_path):
    with pytest.raises(AssertionError):
        Reader(tmp_path).follow(f"```sh\n{line}\n```\n")
    Reader(tmp_path).follow(f"```sh\n{line}    {MARK}needs a robot\n```\n")


def test_the_owner_s_words_are_on_the_phone():
    folder = ROOT / "fasaco_edge" / "serve" / "page"
    shown = "".join(file.read_text() for file in (*folder.glob("*.html"), *folder.glob("*.js")))
    words = set(re.findall(r"\*\*(.+?)\*\*", page(OWNER)))
    assert len(words) > 10
    assert [word for word in sorted(words) if word not in shown] == []
