"""Give memory that is free back to the system."""

import contextlib
import ctypes


def release_memory() -> None:
    """Give free memory back, where the allocator is GNU's; by itself it keeps ever more."""
    # Other systems have other allocators.
    with contextlib.suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
