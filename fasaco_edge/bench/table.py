"""All benchmarks, in the order they are listed."""

from __future__ import annotations

from typing import Any

from fasaco_edge.bench.benchmark import Benchmark
from fasaco_edge.bench.codec import CODEC
from fasaco_edge.bench.footprint import FOOTPRINT
from fasaco_edge.bench.ingest import INGEST
from fasaco_edge.bench.jitter import JITTER
from fasaco_edge.bench.latency import LATENCY
from fasaco_edge.bench.online import ONLINE
from fasaco_edge.bench.quality import QUALITY
from fasaco_edge.bench.scale import SCALE
from fasaco_edge.bench.speed import SPEED
from fasaco_edge.bench.table1 import TABLE1

BENCHMARKS: tuple[Benchmark[Any], ...] = (
    SPEED, FOOTPRINT, CODEC, INGEST, LATENCY, JITTER, TABLE1, QUALITY, SCALE, ONLINE,
)  # fmt: skip
