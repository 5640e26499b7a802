"""Buildings of several sizes, each planned in a process of its own."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Generator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fasaco_edge.bench.benchmark import Say
from fasaco_edge.errors import BadConfiguration, ProcessEnded
from fasaco_edge.host.processes import python_program
from tests.benchmarks.buildings import building
from tests.benchmarks.scale.process import ScaleRun, ScaleTask

PROGRAM = python_program("tests.benchmarks.scale.process")
WARM_S = 0.1


@dataclass(frozen=True, slots=True)
class SizedRun:
    """A run, and the number of cells that was asked for."""

    size: int
    run: ScaleRun


def budgets(sizes: Sequence[int], given: Sequence[float]) -> tuple[float, ...]:
    """Return for how long to plan on each size [s]: as given, or a minute a million cells.

    Raises:
        BadConfiguration: neither one budget is given nor one for each size.
    """
    if not given:
        return tuple(max(1.0, size * 60e-6) for size in sizes)
    if len(given) not in (1, len(sizes)):
        raise BadConfiguration(
            f"--budget-s must be one time, or one for each of {len(sizes)} sizes, got {len(given)}"
        )
    return tuple(given) * (len(sizes) if len(given) == 1 else 1)


def measure(
    sizes: Sequence[int], budgets_s: Sequence[float], seeds: int, say: Say
) -> Generator[SizedRun, None, None]:
    """Yield every run; each seed goes over all sizes before the next one does.

    Raises:
        ProcessEnded: a process failed; its message says why, such as a walk that is wrong.
    """
    with tempfile.TemporaryDirectory(prefix="fasaco-bench-") as folder:
        file = Path(folder) / "building.npy"
        say("warming the kernels' cache")
        _write_building(file, min(sizes), 0)
        planned(ScaleTask(str(file), 0, WARM_S))
        for seed in range(seeds):
            for size, budget_s in zip(sizes, budgets_s, strict=True):
                say(f"seed {seed}: {size:,} cells")
                _write_building(file, size, seed)
                yield SizedRun(size, planned(ScaleTask(str(file), seed, budget_s)))


def _write_building(file: Path, cells: int, seed: int) -> None:
    grid = building(cells, seed)
    np.save(file, grid.lattice.coverable)
    start = json.dumps({"start": list(grid.start)})
    file.with_suffix(".json").write_text(start, encoding="utf-8")


def planned(task: ScaleTask) -> ScaleRun:
    """Return what a process of its own measured.

    Raises:
        ProcessEnded: it failed.
    """
    try:
        ended = subprocess.run(
            PROGRAM, input=json.dumps(asdict(task)), check=True, capture_output=True, text=True
        )
    except subprocess.CalledProcessError as error:
        raise ProcessEnded(f"planning ended with {error.returncode}:\n{error.stderr}") from error
    return ScaleRun.of(json.loads(ended.stdout))
