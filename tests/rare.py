"""Leave cases of a parametrised test to the thorough ones."""

from collections.abc import Iterable
from typing import Any

import pytest


def rare(values: Iterable[Any], *kept: Any) -> list[Any]:
    """Mark all values but those ``kept`` as thorough."""
    return [
        value if value in kept else pytest.param(value, marks=pytest.mark.thorough)
        for value in values
    ]
