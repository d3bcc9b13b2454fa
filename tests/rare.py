"""Leave cases of a parametrised test to the thorough ones, or to those that are tried weekly."""

from collections.abc import Iterable
from typing import Any

import pytest


def rare(values: Iterable[Any], *kept: Any, mark: str = "thorough") -> list[Any]:
    """Mark all values but those ``kept``."""
    marks = getattr(pytest.mark, mark)
    return [
        value if value in kept else pytest.param(value, marks=marks) for value in values
    ]
