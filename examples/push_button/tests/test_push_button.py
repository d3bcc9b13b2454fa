"""The task and the strategy pass the checks of their kinds."""

from collections.abc import Callable

import pytest

from core.plugins import PluginPart
from plugins.conformance.suites import SUITES, subject

PARTS = [("task", "PushButton"), ("evolution", "restarts")]
CASES = [
    pytest.param(kind, name, check, id=f"{name}-{check.__name__}")
    for kind, name in PARTS
    for check in SUITES[kind]
]


@pytest.mark.parametrize(("kind", "name", "check"), CASES)
def test_conforms(kind: str, name: str, check: Callable[[object], object]) -> None:
    check(subject(PluginPart(kind, name)))
