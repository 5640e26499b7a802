"""Broken bytes for every decoder, a million of them.

    python -m tests.campaigns.fuzz_wire --mutations 1000000

Takes minutes.

Each mutation of a valid vector has to be refused by the one named error, or to be read as a
value that holds what the contract promises and is the same after encoding and decoding it.
Of some the memory is watched while they are decoded. Warnings count as failures.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time
import traceback
import tracemalloc
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

from rich import box
from rich.table import Table

from fasaco_edge.cli.console import terminal
from tests.wire.decoders import DECODERS
from tests.wire.encoders import ENCODERS
from tests.wire.mutations import mutant, seeds_of
from tests.wire.soundness import is_read, peak_bytes

# Watching memory makes decoding ten times slower.
WATCHED = 64
BATCH = 1000
# Of one kind of failure the first is enough to go on with.
TOLD = 20


@dataclass
class Tally:
    """What came of the mutations of one message type.

    Attributes:
        schema: the message type.
        encodes: whether what is read is encoded again.
        mutations, refused, read, watched: how many; ``watched`` of them for memory.
        peak: most memory that one decoding took [bytes].
        wall_s: seconds it took.
        failures: by error and place: how many, and the first payload as hex.
    """

    schema: str
    encodes: bool
    mutations: int = 0
    refused: int = 0
    read: int = 0
    watched: int = 0
    peak: int = 0
    wall_s: float = 0.0
    failures: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def rate(self) -> float:
        """Mutations a second."""
        return self.mutations / self.wall_s if self.wall_s else 0.0


def run_campaign(schema: str, mutations: int, seed: int, advance: Callable[[int], object]) -> Tally:
    """Judge so many mutations of one message type; ``advance`` is called for every batch."""
    rng, seeds = random.Random(f"{seed} {schema}"), seeds_of(schema)
    tally = Tally(schema, schema in ENCODERS)
    # What is loaded or cached on first use is none of the decoder's memory.
    for payload in seeds:
        _judge(Tally(schema, tally.encodes), payload)
    started = time.perf_counter()
    while tally.mutations < mutations:
        batch = min(BATCH, mutations - tally.mutations)
        payloads = [mutant(rng, seeds) for _ in range(batch)]
        for payload in payloads:
            _judge(tally, payload)
        _watch(tally, payloads[::WATCHED])
        tally.mutations += batch
        advance(batch)
    tally.wall_s = time.perf_counter() - started
    return tally


def _judge(tally: Tally, payload: bytes) -> None:
    try:
        if is_read(tally.schema, payload):
            tally.read += 1
        else:
            tally.refused += 1
    except Exception as error:
        _note(tally, payload, error)


def _watch(tally: Tally, payloads: list[bytes]) -> None:
    tracemalloc.start()
    try:
        for payload in payloads:
            tally.watched += 1
            try:
                tally.peak = max(tally.peak, peak_bytes(tally.schema, payload))
            except Exception as error:
                _note(tally, payload, error)
    finally:
        tracemalloc.stop()


def _note(tally: Tally, payload: bytes, error: Exception) -> None:
    """Keep the first payload of each kind of failure."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    kind = f"{type(error).__name__} in {place.name}, line {place.lineno}"
    if kind in tally.failures:
        tally.failures[kind]["count"] += 1
    elif len(tally.failures) < TOLD:
        tally.failures[kind] = {"count": 1, "text": str(error), "payload": payload.hex()}


def main() -> int:
    """Run the campaign over all message types, print its table; 1 if anything failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mutations", type=int, default=100_000, help="of each message type")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=sorted(DECODERS), metavar="SCHEMA")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    args = parser.parse_args()
    warnings.simplefilter("error")
    tallies = []
    with terminal.progress() as bar:
        for schema in args.only or DECODERS:
            task = bar.add_task(schema.rsplit("/", 1)[1], total=args.mutations)
            tallies.append(
                run_campaign(schema, args.mutations, args.seed, partial(bar.advance, task))
            )
    if args.json:
        types = [{**asdict(tally), "per_s": round(tally.rate)} for tally in tallies]
        print(json.dumps({"seed": args.seed, "types": types}))
    else:
        _print(tallies)
    return int(any(tally.failures for tally in tallies))


def _print(tallies: list[Tally]) -> None:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 0, 0, 1))
    for column in ("type", "mutations", "refused", "read", "same again", "peak [B]", "failed", "s"):
        table.add_column(column, justify="left" if column == "type" else "right")
    for tally in tallies:
        failed = sum(failure["count"] for failure in tally.failures.values())
        table.add_row(
            tally.schema.rsplit("/", 1)[1],
            *(f"{count:,}" for count in (tally.mutations, tally.refused, tally.read)),
            "yes" if tally.encodes else "no encoder",
            f"{tally.peak:,}",
            f"[red]{failed:,}[/]" if failed else "0",
            f"{tally.wall_s:.0f}",
        )
    terminal.out().print(table)
    for tally in tallies:
        for kind, failure in tally.failures.items():
            print(f"{tally.schema}: {failure['count']} x {kind}: {failure['text']}")
            print(f"  {failure['payload']}")


if __name__ == "__main__":
    sys.exit(main())
