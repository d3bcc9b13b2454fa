"""Rewards that are recorded twice are the same bits; one that is changed, lost or of another design is found."""

import json
import sys
from pathlib import Path

import pytest

from core.errors import UsageError, UserError
from tests.benchmarks import golden

pytestmark = pytest.mark.slow


def call(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["", *words])
    golden.main()


@pytest.mark.thorough
def test_the_same_code_earns_the_same_bits(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    few = ["tasks=BringCube", "sims=mujoco", "designs=2", "workers=1"]
    call(monkeypatch, "record", "folder=before", *few)
    call(monkeypatch, "record", "folder=after", "like=before", *few)
    capsys.readouterr()
    call(monkeypatch, "compare", "before", "after")
    assert "| BringCube | mujoco | 3 | 0 | 0 | 0 |" in capsys.readouterr().out

    solution = Path("after/solutions/BringCube.mujoco.json")
    (earned,) = json.loads(solution.read_text())
    assert earned["reward"] > 0.95
    changed = {**earned, "reward": earned["reward"] + 2**-53}  # the last bit
    solution.write_text(json.dumps([changed]))
    rewards = Path("after/rewards/BringCube.json")
    (found,) = json.loads(rewards.read_text())
    rewards.write_text(json.dumps([{**found, "rewards": found["rewards"][:1]}]))
    with pytest.raises(UserError, match="after: of 3 rewards 1 differ, 1 missing"):
        call(monkeypatch, "compare", "before", "after")
    assert "| BringCube | mujoco | 3 | 1 | 1 | 1.11e-16 |" in capsys.readouterr().out

    # What is there is read, not measured again.
    kept = [{**found, "rewards": [0.123] * 2}]
    rewards = Path("before/rewards/BringCube.json")
    rewards.write_text(json.dumps(kept))
    call(
        monkeypatch,
        "record",
        "folder=before",
        *few,
        "sims=[mujoco,{name: mujoco, time_step: 0.004}]",
    )
    (first, second) = json.loads(rewards.read_text())
    assert [first] == kept
    assert second["engine"]["time_step"] == 0.004
    with pytest.raises(UserError, match=r"designs.BringCube.json has other designs"):
        call(monkeypatch, "record", "folder=before", *few, "seed=5")

    designs = Path("after/designs/BringCube.json")
    document = json.loads(designs.read_text())
    document["strategies"].reverse()
    designs.write_text(json.dumps(document))
    with pytest.raises(
        UserError, match=r"has other designs than .*; record again with like=before"
    ):
        call(monkeypatch, "compare", "before", "after")


def test_mistakes(tmp_path, monkeypatch):
    with pytest.raises(UserError, match="of 0 rewards"):
        call(monkeypatch, "compare", str(tmp_path / "a"), str(tmp_path / "b"))
    words = ["tasks=BringCube", "workers=1", "sims=[mujoco]"]
    with pytest.raises(UserError, match=r"like=\S+: there is no folder"):
        call(monkeypatch, "record", f"like={tmp_path}", *words)
    for words in ([], ["record", "before", "after"], ["compare", "before"]):
        with pytest.raises(UsageError):
            call(monkeypatch, *words)
