"""The command lines of the measurements."""

from dataclasses import dataclass, field

import pytest

from core.errors import UsageError
from tests.benchmarks import measuring


@dataclass
class Example:
    names: list[str] = field(default_factory=list)
    steps: list[float] = field(default_factory=lambda: [0.1])
    count: int = 3


def test_settings():
    assert measuring.settings([], Example) == Example()
    assert measuring.settings(
        ["names=a,b", "steps=0.001,2", "count=5"], Example
    ) == Example(["a", "b"], [0.001, 2.0], 5)
    assert measuring.settings(["names=[a,b]"], Example) == Example(["a", "b"])
    with pytest.raises(UsageError, match=r"no key 'nams' \(did you mean 'names'\?\)"):
        measuring.settings(["nams=a"], Example)
    with pytest.raises(UsageError, match="many"):
        measuring.settings(["count=many"], Example)
    with pytest.raises(
        UsageError, match=r"no task 'OneBok' \(did you mean 'OneBook'\?\)"
    ):
        measuring.tasks(["OneBok"])
