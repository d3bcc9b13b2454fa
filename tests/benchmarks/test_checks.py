import pytest

from tests.benchmarks import checks

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


def test_each_check_has_a_share(monkeypatch, capsys):
    for holder, name, _ in checks.CLOCKS:
        monkeypatch.setattr(holder, name, getattr(holder, name))  # so that the clocks are taken off again
    checks.main(["tasks=LidAndBall", "sims=mujoco", "rounds=1"])
    row = [cell.strip() for cell in capsys.readouterr().out.splitlines()[-1].split("|")[1:-1]]
    assert row[:2] == ["LidAndBall", "mujoco"]
    assert all(0 <= float(cell.rstrip("%")) < 50 for cell in row[3:])
    assert float(row[6].rstrip("%")) > 0  # penetration
