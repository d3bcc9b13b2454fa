"""The same seed asks the same: what a rollout took in time is in no prompt."""

import json
import re

import pytest

from core import Experiment
from core.config.compose import load
from core.search.orchestration import run
from plugins.new.new_command import write_scene
from plugins.results.pages.runs import find_runs

SEVERAL = ["fitness=robust", "fitness.sims=[mujoco,sapien]", "fitness.seeds=[1,2]"]
SEVERAL += ["prompt.feedback=numbers", "budget.reward_save=-1", "budget.k_top=10"]
SMALL = [
    "budget.n_agent=1",
    "budget.n_tool=2",
    "budget.n_action=2",
    "budget.n_iteration=1",
    "prompt.picture=false",
]


pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("inline")]


@pytest.mark.thorough
def test_two_runs_send_the_same_prompts_byte_by_byte(tmp_path):
    sent = []
    for name in ("one", "other"):
        made = Experiment(
            *SEVERAL,
            *SMALL,
            task="BringCube",
            sim="mujoco",
            listener=[],
            film=False,
            seed=4,
        )
        made.run(tmp_path / name)
        sent.append(
            {
                file.name: file.read_bytes()
                for file in sorted((tmp_path / name / "requests").iterdir())
            }
        )
    assert sent[0] == sent[1]
    last = sent[0]["g1-a0.md"].decode()
    assert '"engines"' in last
    assert not re.search(
        r"saved|seconds",
        re.search(r"## The elites\n.*?```json\n(.*?)```", last, re.DOTALL)[1],
    )


def test_the_task_of_a_scene_file_is_called_by_its_name(tmp_path):
    for name in ("PushBlock", "PullBlock"):
        file = write_scene(name, tmp_path / f"{name}.yaml")
        words = [
            "task=file",
            f"task.file={file}",
            "budget=tiny",
        ]
        words += [
            "budget.n_iteration=0",
            "listener=[]",
            "film=false",
            "sim=mujoco",
            "prompt.picture=false",
        ]
        run(load("config", words), tmp_path / name)
        result = json.loads((tmp_path / name / "result.json").read_text())
        assert (result["task"], result["fitness"]) == (name, "nominal")
    runs, _ = find_runs([tmp_path])
    assert sorted(run.task for run in runs) == ["PullBlock", "PushBlock"]
