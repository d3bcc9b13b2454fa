"""The command lines of the measurements, and how many designs they take."""

from dataclasses import dataclass, field

import pytest

from core.errors import UsageError
from tests.benchmarks import measuring


@pytest.mark.parametrize("count", [1, 2, 5, 24, 100, 400])
def test_a_generation_has_enough_designs(count):
    budget = measuring.population(count)
    assert budget["n_agent"] * budget["n_tool"] * budget["n_action"] >= count / 2


def test_evenly():
    assert measuring.evenly(list(range(10)), 4) == [0, 3, 6, 9]
    assert measuring.evenly([1, 2], 4) == [1, 2]
    assert measuring.evenly([], 4) == []


@dataclass
class Example:
    names: list[str] = field(default_factory=list)
    steps: list[float] = field(default_factory=lambda: [0.1])
    count: int = 3


def test_settings():
    assert measuring.settings([], Example) == Example()
    assert measuring.settings(["names=a,b", "steps=0.001,2", "count=5"], Example) == Example(
        ["a", "b"], [0.001, 2.0], 5
    )
    assert measuring.settings(["names=[a,b]"], Example) == Example(["a", "b"])
    with pytest.raises(UsageError, match=r"no key 'nams' \(did you mean 'names'\?\)"):
        measuring.settings(["nams=a"], Example)
    with pytest.raises(UsageError, match="many"):
        measuring.settings(["count=many"], Example)
    with pytest.raises(UsageError, match=r"no task 'OneBok' \(did you mean 'OneBook'\?\)"):
        measuring.tasks(["OneBok"])
