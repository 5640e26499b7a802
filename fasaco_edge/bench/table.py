"""All benchmarks, in the order they are listed."""

from __future__ import annotations

from typing import Any

from fasaco_edge.bench.benchmark import Benchmark
from fasaco_edge.bench.footprint import FOOTPRINT
from fasaco_edge.bench.jitter import JITTER
from fasaco_edge.bench.latency import LATENCY
from fasaco_edge.bench.speed import SPEED

BENCHMARKS: tuple[Benchmark[Any], ...] = (
    SPEED, FOOTPRINT, LATENCY, JITTER,
)  # fmt: skip
