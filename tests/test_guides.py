"""Files that the guides name are there; command lines of guides and helps are understood."""

from __future__ import annotations

import argparse
import re
import shlex
from importlib import import_module
from pathlib import Path

import pytest

from fasaco_edge.bench.benchmark import Benchmark
from fasaco_edge.cli import COMMANDS, _parser
from fasaco_edge.cli.bench import BENCHMARKS as ON_THE_ROBOT
from fasaco_edge.cli.bench import add_benchmarks
from tests.benchmarks.__main__ import BENCHMARKS as FOR_DEVELOPERS

ROOT = Path(__file__).parents[1]
GUIDES = sorted(
    str(file.relative_to(ROOT))
    for pattern in ("*.md", "fasaco_edge/*.md", "deploy/*.md", "protocol/*.md", "maps/*.md")
    for file in ROOT.glob(pattern)
    if file.name != "CHANGELOG.md"
)
COMMAND_LINE = re.compile(r"^\s*(?:\.venv/bin/)?fasaco-edge ((?:.*\\\n)*.*)$", re.M)
BENCHMARK_LINE = re.compile(r"^\s*python -m tests\.benchmarks ((?:.*\\\n)*.*)$", re.M)


LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)")


def places_of(page: Path) -> set[str]:
    """Return the anchors of a page's headings."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", sorted({*ROOT.glob("*.md"), *ROOT.glob("[a-z]*/**/*.md")}))
def test_each_link_of_a_page_leads_somewhere(page):
    for file, place in LINK.findall(page.read_text(encoding="utf-8")):
        if file.startswith(("http:", "https:")):
            continue
        there = (page.parent / file).resolve() if file else page
        assert there.exists(), f"{file}: there is none"
        if place:
            assert place in places_of(there), f"{file}#{place}: there is no such heading"


def words_of(line: str) -> list[str]:
    """Return the words of a command line in a shell, without redirections and what follows it."""
    words = shlex.split(line.replace("\\\n", " "), comments=True)
    ends = [at for at, word in enumerate(words) if word in ("|", "||", "&&", ">", "&")]
    return words[: min(ends, default=len(words))]


def assert_understood(words: list[str]) -> None:
    """Parse a command line, and do no more."""
    try:
        _parser(words).parse_args(words)
    except SystemExit:
        pytest.fail(f"not understood: fasaco-edge {shlex.join(words)}")


def helps() -> list[str]:
    """Return what the commands and benchmarks say after their options."""
    commands = [import_module(f"fasaco_edge.cli.{name.replace('-', '_')}") for name in COMMANDS]
    benchmarks: tuple[Benchmark, ...] = (*ON_THE_ROBOT, *FOR_DEVELOPERS)
    return [each.COMMAND.epilog or "" for each in commands] + [each.epilog for each in benchmarks]


@pytest.mark.parametrize("guide", GUIDES)
def test_each_command_line_of_a_guide_is_understood(guide):
    text = (ROOT / guide).read_text(encoding="utf-8")
    blocks = re.findall(r"^ *```(\w*)\n(.*?)^ *```$", text, re.M | re.S)
    for line in COMMAND_LINE.findall(
        "\n".join(said for kind, said in blocks if kind in ("", "sh"))
    ):
        assert_understood(words_of(line))


def test_each_command_line_of_a_help_is_understood():
    found = []
    for text in helps():
        for line in COMMAND_LINE.findall(text):
            # A remark stands apart.
            found.append(re.split(r"\s{2,}(?=[^\s-])", line.strip())[0])
            assert_understood(words_of(found[-1]))
    assert len(found) > 60


def test_each_benchmark_that_a_guide_or_help_runs_is_understood():
    pages = [page.read_text(encoding="utf-8") for page in ROOT.glob("tests/benchmarks/*.md")]
    lines = [line for text in (*pages, *helps()) for line in BENCHMARK_LINE.findall(text)]
    assert len(lines) > 20
    for line in lines:
        parser = argparse.ArgumentParser()
        add_benchmarks(parser, FOR_DEVELOPERS)
        words = words_of(re.split(r"\s{3,}(?=[a-z])", line.strip())[0])
        parser.parse_args(words)


@pytest.mark.parametrize("guide", ["CONTRIBUTING.md", "fasaco_edge/README.md"])
def test_each_file_that_a_guide_names_is_there(guide):
    named = re.findall(r"`([\w/-]+\.(?:py|md|yaml))`", (ROOT / guide).read_text(encoding="utf-8"))
    assert len(named) > 20
    folders = ROOT, ROOT / "fasaco_edge"
    assert [name for name in named if not any((at / name).is_file() for at in folders)] == []


@pytest.mark.parametrize("guide", ["CONTRIBUTING.md"])
def test_each_function_that_a_guide_names_is_there(guide):
    text = re.sub(r"```.*?```", "", (ROOT / guide).read_text(encoding="utf-8"), flags=re.S)
    spans = re.findall(r"`([^`]*)`", text)
    names = {name for span in spans for name in re.findall(r"\b([a-zA-Z_]\w*)\(", span)}
    sources = "".join(
        file.read_text(encoding="utf-8")
        for folder in ("fasaco_edge", "tests")
        for file in (ROOT / folder).rglob("*.py")
    )
    unknown = {
        name for name in names if not re.search(rf"(?:def|class) {name}\b|\b{name} = ", sources)
    }
    assert names
    assert unknown <= {"f", "partial"}
