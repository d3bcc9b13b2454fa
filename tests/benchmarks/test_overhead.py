import pytest

from core.errors import UsageError, UserError
from tests.benchmarks import measuring, overhead

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


@pytest.mark.weekly
def test_two_commits_are_measured_with_their_own_code_and_leave_nothing(
    monkeypatch, capsys
):
    made = []
    declare = overhead._declare
    monkeypatch.setattr(
        overhead, "_declare", lambda tree: (made.append(tree), declare(tree))
    )
    monkeypatch.setattr(measuring.console, "width", 120)
    overhead.main(
        ["HEAD", "HEAD~0", "sims=mujoco", "rounds=1", "workers=1", "tools=1", "plans=2"]
    )
    rows = [
        line.split("│")[1:-1]
        for line in capsys.readouterr().out.splitlines()
        if "BringCube" in line
    ]
    assert [row[2].strip() for row in rows] == ["HEAD", "HEAD~0"]
    assert all(float(row[3].split()[0]) > 1 and float(row[5]) > 0 for row in rows)
    assert len(made) == 2
    assert not any(tree.exists() for tree in made)


def test_what_cannot_be_measured_is_refused():
    with pytest.raises(UsageError, match="usage"):
        overhead.main(["HEAD"])
    with pytest.raises(UserError, match=r"git worktree add.*no-such-commit"):
        overhead.main(["HEAD", "no-such-commit"])
