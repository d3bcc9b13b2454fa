"""The measurements' arithmetic, and that they go on where they were cut short."""

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.errors import UsageError, UserError
from tests.benchmarks import agreement, measuring

# --- comparing --------------------------------------------------------------------------------------------------


@given(st.lists(st.integers(0, 100), min_size=3, max_size=30, unique=True), st.randoms())
def test_the_same_order_is_1_the_reverse_is_minus_1(percent, random):
    a = [p / 100 for p in percent]
    first = [random.random() < 0.5 for _ in a]
    assert measuring.compare(a, a, first)["rank_correlation"] == pytest.approx(1)
    assert measuring.compare(a, [1 - r for r in a], first)["rank_correlation"] == pytest.approx(-1)
    assert measuring.compare(a, a, first)["mean_difference"] == 0


def test_what_is_less_than_a_hundredth_apart_ranks_alike():
    figures = measuring.compare([0.991, 0.992, 0.993, 0.1], [0.994, 0.993, 0.992, 0.2], [True] * 4)
    assert figures["rank_correlation"] == pytest.approx(1)
    assert figures["tied"] == 0.75


def test_an_engine_that_gives_all_the_same_has_no_rank_correlation():
    figures = measuring.compare([1.0, 1.0, 1.0], [0.1, 0.5, 0.9], [True, True, False])
    assert figures["rank_correlation"] is None
    assert figures["of_offspring"] is None
    assert figures["tied"] == 1
    assert measuring.number(None) == "–"


def test_how_many_good_designs_stay_good():
    figures = measuring.compare(
        [0.9, 0.7, 0.61, 0.6, 0.1], [0.9, 0.41, 0.4, 0.9, 0.9], [True, True, False, False, True]
    )
    assert figures["kept"] == [2, 3]
    assert figures["kept_back"] == [2, 3]
    assert figures["means"] == [pytest.approx(0.582), pytest.approx(0.702)]
    assert figures["designs"] == 5
    assert measuring.kept_share([[2, 3], [1, 1]]) == "3/4 (75%)"
    assert measuring.kept_share([[999, 1000]]) == "999/1000 (99%)"
    assert measuring.kept_share([[0, 0]]) == "0/0"


def test_halves_are_compared_by_themselves():
    a, b = [0.1, 0.2, 0.3, 0.7, 0.8, 0.9], [0.1, 0.2, 0.3, 0.9, 0.8, 0.7]
    figures = measuring.compare(a, b, [True, True, True, False, False, False])
    assert figures["of_first_sampling"] == pytest.approx(1)
    assert figures["of_offspring"] == pytest.approx(-1)
    assert 0 < figures["rank_correlation"] < 1


@pytest.mark.parametrize("count", [1, 2, 5, 24, 100, 400])
def test_a_generation_has_enough_designs(count):
    budget = measuring.population(count)
    assert budget["n_agent"] * budget["n_tool"] * budget["n_action"] >= count / 2


def test_evenly():
    assert measuring.evenly(list(range(10)), 4) == [0, 3, 6, 9]
    assert measuring.evenly([1, 2], 4) == [1, 2]
    assert measuring.evenly([], 4) == []


# --- the command line ------------------------------------------------------------------------------


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


# --- real engines -----------------------------------------------------------------------------------------------


def measure(monkeypatch, module, *words):
    monkeypatch.setattr(sys, "argv", ["", "tasks=BringCube", "designs=4", "workers=1", *words])
    module.main()


@pytest.mark.slow
@pytest.mark.thorough
def test_the_same_designs_are_measured_and_nothing_twice(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    measure(monkeypatch, agreement, "sims=[pybullet,{name: pybullet, time_step: 0.008}]")
    assert "| BringCube | 4 |" in capsys.readouterr().out
    document = json.loads(Path("measured/designs/BringCube.json").read_text())
    assert [name[:2] for name in document["ids"]] == ["g0", "g0", "g1", "g2"]
    (row,) = json.loads(Path("measured/agreement.json").read_text())
    assert row["engines"] == ["pybullet", "pybullet time_step=0.008"]
    file = Path("measured/rewards/BringCube.json")
    records = json.loads(file.read_text())
    assert [record["engine"]["time_step"] for record in records] == [0.002, 0.008]
    assert row["means"] == [pytest.approx(np.mean(record["rewards"])) for record in records]
    assert all(0 < seconds < 60 for record in records for seconds in record["cpu_s"])

    records[0]["rewards"][0] = 0.123  # what is there is read, not measured again
    file.write_text(json.dumps(records))
    measure(monkeypatch, agreement, "sims=[pybullet,{name: pybullet, time_step: 0.004}]")
    now = json.loads(file.read_text())
    assert now[:2] == records
    assert now[2]["engine"]["time_step"] == 0.004
    with pytest.raises(UserError, match=r"designs.BringCube.json has other designs"):
        measure(monkeypatch, agreement, "seed=5")
