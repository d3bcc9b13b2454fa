"""Scenes that are played from both sides: who bears whom, in `bearing.yaml`, and what an idle arm sees, in `idle.yaml`.

A case has the things of a scene file and its goals. A box of a ``tool`` is [name, parent, size, position], and a
waypoint of a plan's ``path`` is [x, y, z, speed, wait]; without them the arm waits. What a plan ``expects``: how far
each goal is fulfilled, by name; ``earns``: the reward; ``says``: what its outcome begins with. ``engines`` are those
that can play it, where not all can; in those that are ``thorough`` it takes more than 5 s. A case that is ``refused``
is not read, for this reason.
"""

import json
import re
from pathlib import Path

import pytest
import yaml

from core.designs.reading import read_designs
from core.errors import UserError
from core.interfaces import RolloutSettings
from core.plugins import installed
from tests.support.engines import SIMULATORS, simulator
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch
from tests.support.scene_files import task_of

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
BEARING = yaml.safe_load((HERE / "bearing.yaml").read_text())
IDLE = yaml.safe_load((HERE / "idle.yaml").read_text())
CASES = BEARING | IDLE
KEYS = ("bodies", "joints", "bonds", "marks")
STEM = ["stem", "tool_mount", [0.02, 0.02, 0.05], [0, 0, -0.025]]
HOME = [0.5, 0, 0.5, 0, 1]
SETTINGS = RolloutSettings(observe=True)


def read(folder, name):
    """Read the task of a case, and a candidate of each of its plans."""
    case = CASES[name]
    text = {
        "name": "Played",
        "description": f"This is played: {name}.",
        "every": True,
        **{key: case[key] for key in KEYS if key in case},
        "goals": case["goals"],
    }
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
        "tool_components": [component(*part) for part in case.get("tool", [STEM])],
        "action_sets": [
            [waypoint(*at) for at in plan.get("path", [HOME])] for plan in case["plans"]
        ],
    }
    parts = installed()
    anchored = parts.create("action", "anchored")
    boxes = parts.create("tool", "boxes")
    return task, read_designs({"strategies": [design]}, boxes, task, actions=anchored)


def check(plan, trial):
    """Check what became of a plan."""
    goals = dict(trial.goals)
    outcome = f"{trial.outcome} {trial.reason}"
    if "expects" in plan:
        assert trial.reason == ""
        assert goals == pytest.approx(plan["expects"], abs=0.01)
    if "earns" in plan:
        assert trial.reward == pytest.approx(plan["earns"], abs=0.01), outcome
        assert trial.solved == (plan["earns"] == 1)
    if "says" in plan:
        assert re.match(f"(forbidden )?{plan['says']}", outcome), outcome


def list_played():
    """List each case in each engine that can play it."""
    for name, case in CASES.items():
        for engine in case.get("engines", SIMULATORS):
            takes_long = engine in case.get("thorough", ())
            marks = [pytest.mark.thorough] if takes_long else []
            yield pytest.param(name, engine, id=f"{name}, {engine}", marks=marks)


@pytest.mark.parametrize(("name", "engine"), [*list_played()])
def test_what_is_played_is_what_a_case_expects(tmp_path, name, engine):
    case = CASES[name]
    if "refused" in case:
        with pytest.raises(UserError, match=case["refused"]):
            read(tmp_path, name)
        return

    task, found = read(tmp_path, name)
    tried = evaluate_batch(task, simulator(engine), found, settings=SETTINGS)
    for plan, evaluation in zip(case["plans"], tried, strict=True):
        check(plan, evaluation.trials[0])
