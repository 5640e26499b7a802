"""Settings for all tests."""

from hypothesis import settings

# The first example may compile a kernel, or read it from the cache.
settings.register_profile("kernels", deadline=None)
settings.load_profile("kernels")
