"""Entries from Python to inner kernels, which only kernels call."""

from collections.abc import Callable
from typing import TypeVar

from fasaco_edge.kernels.jit import kernel

Inner = TypeVar("Inner", bound=Callable[..., object])


def entry(inner: Inner) -> Inner:
    """Return a kernel that calls an inner one; each process compiles it anew."""

    def called(*given):
        return inner(*given)

    return kernel(called)
