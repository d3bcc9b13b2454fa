import sys

import pytest

from core.errors import UsageError
from tests.benchmarks import checks

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


def measure(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["", *words])
    checks.main()


def test_the_shares_of_a_rollout(monkeypatch, capsys):
    measure(monkeypatch, "tasks=BringCube", "tools=1", "plans=2", "repeats=1")
    _, _, row, mean, together = capsys.readouterr().out.splitlines()
    assert row.startswith("| BringCube |")
    shares = [float(cell.strip(" %")) for cell in row.split("|")[3:5]]
    assert all(0 < share < 50 for share in shares)
    assert mean.split("|")[3:] == row.split("|")[3:] == together.split("|")[3:]


def test_shares_of_a_cost():
    cost = checks.Cost(checked=0.1, plain=0.08, penetration=0.01, self_collision=0.005)
    assert cost.shares == pytest.approx((0.1, 0.05, 0.2))
    other = checks.Cost(checked=0.3, plain=0.3, penetration=0.0, self_collision=0.0)
    *_, mean, together = checks.markdown([("A", cost), ("B", other)]).splitlines()
    assert mean == "| **mean of the shares** | | 5.0% | 2.5% | -10.0% |"
    assert together == "| **share of all time** | 400 | 2.5% | 1.2% | -5.0% |"


def test_what_it_does_not_know_is_said(monkeypatch):
    with pytest.raises(UsageError, match=r"did you mean 'tools'"):
        measure(monkeypatch, "tool=3")
