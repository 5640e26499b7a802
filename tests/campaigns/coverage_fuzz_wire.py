"""Bytes that lead decoders into new branches, bred by atheris (libFuzzer).

    python -m pip install atheris
    python -m tests.campaigns.coverage_fuzz_wire --seconds 300

Takes hours.

Every message type is fuzzed in a process of its own, from its valid and hostile vectors on.
What fuzz_campaign asks of a payload is asked here too; a payload that fails is kept.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import re
import subprocess
import sys
import tempfile
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path

LARGEST = 1024
# libFuzzer's last words, and those it has for every new find.
EXECUTED = re.compile(r"stat::number_of_executed_units:\s+(\d+)")
FOUND = re.compile(r"cov: (\d+) ft: (\d+) corp: (\d+)/")


@dataclass(frozen=True)
class Outcome:
    """What came of fuzzing one message type.

    Attributes:
        schema: the message type.
        executed: how many payloads were judged.
        seeds, corpus: payloads it began with, and those kept as each reached something new.
        edges: branches of the code that were reached.
        failure: the traceback of the payload that failed; empty if none did.
        payload: that payload, as hex.
    """

    schema: str
    executed: int
    seeds: int
    corpus: int
    edges: int
    failure: str
    payload: str


def fuzz(schema: str, seconds: int, seed: int) -> Outcome:
    """Fuzz one message type in a process of its own."""
    from tests.wire.vectors import vectors

    seeds = [v for v in [*vectors("valid"), *vectors("hostile")] if v.schema == schema]
    with tempfile.TemporaryDirectory() as folder:
        corpus = Path(folder) / "corpus"
        corpus.mkdir()
        for vector in seeds:
            (corpus / vector.name).write_bytes(vector.payload)
        ended = subprocess.run(
            [sys.executable, "-m", "tests.campaigns.coverage_fuzz_wire", "--child", schema,
             str(corpus),
             f"-max_total_time={seconds}", f"-seed={seed + 1}", f"-max_len={LARGEST}",
             "-print_final_stats=1", f"-artifact_prefix={folder}/failed-"],
            capture_output=True, text=True, errors="replace", check=False,
        )  # fmt: skip
        failed = [file.read_bytes().hex() for file in Path(folder).glob("failed-*")]
        said = ended.stdout + ended.stderr
        found, executed = FOUND.findall(said), EXECUTED.search(said)
        edges, _, kept = map(int, found[-1]) if found else (0, 0, 0)
        return Outcome(
            schema,
            int(executed[1]) if executed else 0,
            len(seeds),
            kept,
            edges,
            said[-4000:] if ended.returncode or failed else "",
            failed[0] if failed else "",
        )


def fuzz_here(schema: str, words: list[str]) -> None:
    """Fuzz one message type in this process, which ends with it."""
    import atheris

    with atheris.instrument_imports(include=["fasaco_edge.wire", "fasaco_edge.grid"]):
        from tests.wire.soundness import is_read
    warnings.simplefilter("error")
    atheris.Setup([sys.argv[0], *words], lambda payload: is_read(schema, payload) and None)
    atheris.Fuzz()


def main() -> int:
    """Fuzz all message types one after the other; 1 if a payload failed."""
    if sys.argv[1:2] == ["--child"]:
        fuzz_here(sys.argv[2], sys.argv[3:])
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=int, default=60, help="for each message type")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", metavar="SCHEMA")
    parser.add_argument("--json", action="store_true", help="print the outcomes as JSON")
    args = parser.parse_args()
    if importlib.util.find_spec("atheris") is None:
        parser.error("atheris is not installed: python -m pip install atheris")
    from tests.wire.decoders import DECODERS

    outcomes = []
    for schema in args.only or DECODERS:
        print(f"{schema}: {args.seconds} s", file=sys.stderr)
        outcomes.append(fuzz(schema, args.seconds, args.seed))
    if args.json:
        print(json.dumps([asdict(outcome) for outcome in outcomes]))
    else:
        _print(outcomes)
    return int(any(outcome.failure for outcome in outcomes))


def _print(outcomes: list[Outcome]) -> None:
    from rich import box
    from rich.table import Table

    from fasaco_edge.cli.console import terminal

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 0, 0, 1))
    for column in ("type", "judged", "vectors", "kept", "edges", "failed"):
        table.add_column(column, justify="left" if column == "type" else "right")
    for outcome in outcomes:
        counts = (outcome.executed, outcome.seeds, outcome.corpus, outcome.edges)
        name = outcome.schema.rsplit("/", 1)[1]
        table.add_row(name, *(f"{c:,}" for c in counts), "YES" if outcome.failure else "no")
    terminal.out().print(table)
    for outcome in outcomes:
        if outcome.failure:
            print(f"{outcome.schema}\n{outcome.failure}\n{outcome.payload}")


if __name__ == "__main__":
    sys.exit(main())
