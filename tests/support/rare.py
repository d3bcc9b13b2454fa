"""Leave cases of a parametrised test to the thorough ones, or to those that are tried weekly."""

from collections.abc import Iterable
from typing import Any

import pytest


def rare(values: Iterable[Any], *kept: Any, mark: str = "thorough") -> list[Any]:
    """Mark all values but those ``kept``; a tuple is a row: a value for each argument."""
    marks = getattr(pytest.mark, mark)
    marked = []
    for value in values:
        row = value if isinstance(value, tuple) else (value,)
        marked.append(value if value in kept else pytest.param(*row, marks=marks))

    return marked


def mostly(values: Iterable[Any], *slow: Any) -> list[Any]:
    """Mark those that are ``slow`` as thorough, and no other: the other way round than `rare`."""
    values = [*values]
    return rare(values, *[value for value in values if value not in slow])
