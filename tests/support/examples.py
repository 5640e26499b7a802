"""The number of examples Hypothesis tries: a share of what each test names, or all, or more."""

from __future__ import annotations

import os
from typing import Any

from hypothesis import HealthCheck, settings

# `make test` tries a quarter, others each time; `make properties` four times as many as named.
SHARE = float(os.environ.get("EXAMPLES", "0.25"))
# Whether kernels run in plain Python, which takes many times as long.
PLAIN = os.environ.get("NUMBA_DISABLE_JIT") == "1"
if PLAIN:
    SHARE = min(SHARE, 0.1)
# What Hypothesis tries of itself.
MOST = 100


def examples(most: int, **others: Any) -> settings:
    """Try ``most`` examples in the full run, and a share of them, 8 at least, in the suite.

    None has a deadline, nor a limit on the time that inputs take: the first may compile a kernel,
    or read it from the cache, and a busy machine is slow.
    """
    count = max(round(SHARE * most), min(most, 8))
    suppressed = [HealthCheck.too_slow, *others.pop("suppress_health_check", ())]
    return settings(max_examples=count, deadline=None, suppress_health_check=suppressed, **others)
