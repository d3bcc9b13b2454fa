"""Who bears whom in engines: hooked, glued, hung, drawn and chained things, from both sides."""

import json
from pathlib import Path

import pytest
import yaml

from core.designs.reading import read_designs
from core.plugins import installed
from tests.engines import mujoco_first, simulator
from tests.panda import on_panda
from tests.playing import evaluate_batch
from tests.plugins.tasks.file.test_task import task_of

pytestmark = pytest.mark.slow

CASES = yaml.safe_load(Path(__file__).with_name("bearing.yaml").read_text())


def play(folder, name, engine, *limits):
    """Play all plans of a case, in which these limits hold, too: a trial of each."""
    case = CASES[name]
    keys = ("bodies", "joints", "bonds")
    scene = {key: case[key] for key in keys if key in case}
    text = {
        "name": "Bearing",
        "description": f"The robot does something to {name}.",
        "every": True,
        **scene,
    }
    text["goals"] = [*case["goals"], *limits]
    task = on_panda(task_of(folder, json.dumps(text)))

    def component(name, parent, size, position):
        given = {"name": name, "parent": parent, "size": size, "position": position}
        return {"shape": "box", "mass": 0.02, **given}

    def waypoint(x, y, z, speed, wait):
        tempo = {
            key: value for key, value in (("speed", speed), ("wait", wait)) if value
        }
        return {"offset": [x, y, z], **tempo}

    design = {
        "gripper": False,
        "tool_components": [component(*part) for part in case["tool"]],
        "action_sets": [
            [waypoint(*at) for at in plan["path"]] for plan in case["plans"]
        ],
    }
    parts = installed()
    anchored = parts.create("action", "anchored")
    boxes = parts.create("tool", "boxes")
    read = read_designs({"strategies": [design]}, boxes, task, actions=anchored)
    return [e.trials[0] for e in evaluate_batch(task, simulator(engine), read)]


@mujoco_first
@pytest.mark.parametrize("name", CASES)
def test_what_bears_what(tmp_path, name, engine):
    plans = CASES[name]["plans"]
    for plan, trial in zip(plans, play(tmp_path, name, engine), strict=True):
        assert trial.reason == ""
        assert dict(trial.goals) == pytest.approx(plan["expects"], abs=0.01)
