"""What is taken from source files is enough to read a task, and follows the code."""

import ast
import importlib

from core.interfaces import Task
from core.plugins import installed
from core.robot.trajectory import plan_motion
from core.scene import Body
from core.support.text import function_source
from plugins.vlms.told.source import BODY, TASK, class_source, helpers, task_source
from tasks.bring_cube import BringCube
from tests.faults import Slide


def test_a_class_keeps_its_docstring_and_the_members_that_are_asked_for():
    text = class_source(Body, *BODY)
    ast.parse(text)
    assert text.startswith("@dataclass(frozen=True)\nclass Body:\n")
    assert "product of theirs" in text
    assert "Raises:" not in text
    assert "restitution: float = 0.0" in text
    assert "def " not in text
    task = class_source(Task, *TASK)
    ast.parse(task)
    assert "success_reward: ClassVar[float] = 0.95  # from here on the task counts as solved" in task
    assert task.count("@abstractmethod") == 2
    assert "def source" not in task
    members = {line.split(":")[0].split("(")[0].split()[-1] for line in task.splitlines() if line.startswith("    ")}
    assert set(TASK) <= members


def test_a_function_keeps_its_body():
    text = function_source(plan_motion)
    ast.parse(text)
    assert '"""' not in text
    assert "def plan_motion(" in text
    assert "return make_motion(" in text


def test_helpers_are_those_of_the_tasks_own_package():
    create = installed().create
    assert helpers(create("task", "BringCube")) == ""
    shown = helpers(create("task", "HighObject"))
    ast.parse(shown)
    assert "def open_box(" in shown
    assert "Lengths are outer ones" in shown
    assert "def table(" not in shown  # the table of the layout has its numbers
    assert "return" not in shown
    assert helpers(Slide()) == ""


SHAPES = '''
from functools import cache

@cache
def bracket(
    length: float,
) -> float:
    """A bracket of this length."""
    return 2 * length

def wedge(angle: float) -> float:
    return angle / 2

double = lambda x: 2 * x
'''
PULL = """
from functools import cache
from toy_pack.shapes import bracket, double, wedge
from tests.core.designs.test_composer import PushCube

class Pull(PushCube):
    pass
"""


def test_helpers_of_another_package(tmp_path, monkeypatch):
    folder = tmp_path / "toy_pack"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "shapes.py").write_text(SHAPES)
    (folder / "pull.py").write_text(PULL)
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("toy_pack.pull")
    assert helpers(module.Pull()) == (
        '@cache\ndef bracket(\n    length: float,\n) -> float:\n    """A bracket of this length."""\n\n'
        "def wedge(angle: float) -> float:\n    return angle / 2"
    )


def test_variations_are_shown_where_the_task_has_one():
    usual, near = (task_source(BringCube(variation)) for variation in ("none", "near"))
    assert "variations = {" in near
    assert "variations" not in usual
    ast.parse(usual)
