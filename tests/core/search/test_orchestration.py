"""The same seed asks the same: what a rollout took in time is in no prompt."""

import re

import pytest

from core import Experiment

SAVING = ["fitness=robust", "fitness.sims=[mujoco]", "fitness.seeds=[1,2]"]
SAVING += ["fitness.stop_below=0.99", "prompt.feedback=full", "budget.reward_save=-1", "budget.k_top=10"]
SMALL = ["budget.n_agent=1", "budget.n_tool=2", "budget.n_action=2", "budget.n_iteration=1", "executor.workers=1"]


@pytest.mark.slow
def test_two_runs_send_the_same_prompts_byte_by_byte(tmp_path):
    sent = []
    for name in ("one", "other"):
        run = Experiment(*SAVING, *SMALL, task="BringCube", sim="mujoco", listener=[], film=False, seed=4)
        assert run.run(tmp_path / name).saved.seconds > 0
        sent.append({file.name: file.read_bytes() for file in sorted((tmp_path / name / "requests").iterdir())})
    assert sent[0] == sent[1]
    last = sent[0]["g1-a0.md"].decode()
    assert '"engines"' in last
    assert not re.search(r"saved|seconds", re.search(r"## The elites\n.*?```json\n(.*?)```", last, re.DOTALL)[1])
