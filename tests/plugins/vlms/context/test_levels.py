"""What a designer is told of the scene: at no level more than its name says."""

import re
from functools import cache

import numpy as np
import pytest

from core.config.compose import load
from core.errors import UsageError
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.scene import Box, Cylinder, Sphere
from core.search.experiment import Experiment
from core.values.messages import Text
from plugins.commands.prompt import PromptConfig, compose
from plugins.vlms.context.arm_facts import describe_arm
from plugins.vlms.context.bodies_table import bodies_table
from plugins.vlms.offline.designer import OfflineDesigner
from tests.support.rare import rare

pytestmark = pytest.mark.slow

OF_OTHERS = ("file", "ladder", "multitask")  # tasks whose scene is data or other tasks'
TASKS = [
    offer.name
    for offer in installed().offers.values()
    if offer.kind == "task" and offer.name not in OF_OTHERS
]
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?")


def text_of(request):
    return "\n".join(
        part.text
        for m in request.messages
        for part in m.parts
        if isinstance(part, Text)
    )


def prompt(task, told, *words):
    return text_of(
        compose(
            load(
                "prompt",
                [
                    f"task={task}",
                    "vlm=replay",
                    "sim=mujoco",
                    f"prompt.context={told}",
                    *words,
                ],
                PromptConfig,
            )
        )
    )


def written(values):
    """Ways to write numbers in metres and millimetres, of those with three digits or more: the others are anywhere."""
    forms = {f"{x:.{n}f}" for x in values for n in (3, 4)} | {
        f"{x:.{n}g}" for x in values for n in (3, 4)
    }
    forms |= {f"{1000 * x:.{n}f}" for x in values for n in (0, 1)}
    forms |= {form.lstrip("-") for form in forms}
    return {
        form
        for form in forms
        if len(form.replace(".", "").replace("-", "").strip("0")) >= 3
    }


def numbers_of_scene(task, seed):
    """Places, sizes and masses of all bodies but table and floor."""
    values = []
    for body in task.scene(seed).bodies:
        if body.name in ("table", "floor"):
            continue
        values += [*body.pose.position, body.mass]
        for part in (*body.collisions, *body.visuals):
            values += [*part.pose.position, *(body.pose @ part.pose).position]
            match part.shape:
                case Box(size):
                    values += [*size, *(np.array(size) / 2)]
                case Sphere(radius) | Cylinder(radius, _):
                    values += [radius, 2 * radius]
    return {float(x) for x in np.unique(np.abs(values)) if x}


def leaked(text, task, seed, known=""):
    """The numbers of a scene in a text that are in none that is known."""
    usual = set(NUMBER.findall(known)) | written(
        {abs(float(x)) for x in NUMBER.findall(known)}
    )
    found = {number.lstrip("-") for number in NUMBER.findall(text)} & written(
        numbers_of_scene(task, seed)
    )
    return found - {number.lstrip("-") for number in usual}


@cache
def usual():
    """Prompts of two other tasks, with a gripper and without: what they say is of the arm and the rules."""
    return prompt("OneBook", "pictures") + prompt(
        "OneBook", "pictures", "task.tool_kinds=[gripper]"
    )


@pytest.mark.parametrize("task", rare(TASKS, "LiftBox"))
def test_no_level_without_numbers_has_one_of_the_scene(task, monkeypatch):
    monkeypatch.setattr(
        "plugins.vlms.context.levels.calibrated_pictures", lambda *_, **__: ()
    )
    made = installed().create("task", task, {"variation": "wide"})
    home = " ".join(f"{x:.3f} {x:.4g}" for x in [*made.home.position, *made.home.rpy])
    arm = " ".join(
        repr(describe_arm(made.robot, made.home, RolloutSettings(), "mujoco", gripper))
        for gripper in (False, True)
    )
    words = ("task.variation=wide", "seed=7", "prompt.picture=false")
    known = usual() + made.in_words + home + arm
    assert leaked(prompt(task, "pictures", *words), made, 7, known) == set()
    # What is there is found.
    assert leaked(prompt(task, "words", *words), made, 7, usual())


@pytest.mark.thorough
def test_no_request_of_a_run_has_a_number_of_the_scene(tmp_path, monkeypatch):
    """The embedded designer stands for a model that sees; the numbers of its designs are its own."""
    monkeypatch.setattr(OfflineDesigner, "sees", True)
    monkeypatch.setattr(
        "plugins.vlms.context.levels.calibrated_pictures", lambda *_, **__: ()
    )
    words = "task.variation=wide action=anchored seed=7 film=false executor.workers=1"
    words += " fitness=layouts fitness.layouts=2 fitness.unseen=0 budget.final_s=0"
    words += " prompt.context=pictures prompt.feedback=numbers budget.reward_save=0.0"
    words += " budget.n_agent=1 budget.n_tool=4 budget.n_action=1 budget.n_iteration=2"
    experiment = Experiment(
        *words.split(), "listener=[]", task="MoveBall", sim="mujoco"
    )
    experiment.run(tmp_path / "run")
    task = installed().create("task", "MoveBall", {"variation": "wide"})
    requests = sorted((tmp_path / "run" / "requests").rglob("*.md"))
    replies = " ".join(
        file.read_text()
        for file in (tmp_path / "run" / "replies").rglob("*")
        if file.is_file()
    )
    known = replies + usual()
    texts = [file.read_text() for file in requests]
    assert any("in the picture" in text for text in texts)
    assert any('"contacts"' in text for text in texts)
    for text in texts:
        # What is not shown is not explained.
        assert not re.search(r"`by`|path_m|clearance_m", text)
        assert leaked(text, task, 7, known) | leaked(text, task, 8, known) == set()


def test_a_designer_that_reads_the_numbers_is_refused():
    with pytest.raises(
        UsageError, match=r"prompt\.context=pictures needs a model that sees"
    ):
        Experiment(
            "prompt.context=pictures", "listener=[]", task="BringCube", sim="mujoco"
        ).run("nowhere")


def test_bodies_alike_share_a_row_and_conventions_are_said():
    lines = bodies_table(installed().create("task", "TwoStations"), 0).splitlines()
    assert "| tube | fixed | - | x low end, y middle, z 90 % |" in lines
    assert (
        "| drawer | on a joint | as a full cup | x low end, y middle, z 53 % |" in lines
    )
    assert any(
        "glass_1 ... glass_6 (6)" in line
        for line in bodies_table(
            installed().create("task", "PastGlasses"), 0
        ).splitlines()
    )
