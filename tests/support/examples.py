"""Number of Hypothesis's examples: a share, or a multiple, of the number that a test gives."""

from __future__ import annotations

import os
from typing import Any

from hypothesis import HealthCheck, settings

# `make test` tries a quarter of the number; `make properties` four times the number.
SHARE = float(os.environ.get("EXAMPLES", "0.25"))
# Whether kernels run in plain Python, many times slower.
PLAIN = os.environ.get("NUMBA_DISABLE_JIT") == "1"
if PLAIN:
    SHARE = min(SHARE, 0.1)
# Hypothesis's default number.
MOST = 100


def examples(most: int, **others: Any) -> settings:
    """Try ``most`` examples in the full run; in the suite a share of them, but at least 8.

    Examples have no time limit: the first may compile a kernel or read it from the cache, and a
    busy machine is slow.
    """
    count = max(round(SHARE * most), min(most, 8))
    suppressed = [HealthCheck.too_slow, *others.pop("suppress_health_check", ())]
    return settings(max_examples=count, deadline=None, suppress_health_check=suppressed, **others)
