"""What is taken from source files is enough to read a task, and follows the code."""

import ast
import importlib

from core.plugins import installed
from core.scene import Body
from plugins.new.new_command import write_scene
from plugins.vlms.context.excerpts import class_source, helpers, task_source
from tests.support.faults import Slide
from tests.support.scene_files import task_of


def test_a_class_keeps_its_docstring_and_its_fields():
    text = class_source(Body)
    ast.parse(text)
    assert text.startswith("@dataclass(frozen=True)\nclass Body:\n")
    assert "product of theirs" in text
    assert "Raises:" not in text
    assert "restitution: float = 0.0" in text
    assert "def " not in text


def test_helpers_are_those_of_the_tasks_own_package():
    create = installed().create
    assert helpers(create("task", "BringCube")).startswith("def progress(")
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
from tests.support.briefs import PushCube

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


def test_a_source_is_without_what_is_said_elsewhere():
    create = installed().create
    judged, by_goals = (
        task_source(create("task", name, {"variation": "near"}))
        for name in ("HangRing", "TwoStations")
    )
    for text in (judged, by_goals):
        ast.parse(text)
        assert "variations =" not in text
        for absent in ("in_words =", "description =", "camera =", "import "):
            assert absent not in text
    assert "goals =" not in judged  # its reward does not read them
    assert "every =" not in judged
    assert "goals =" in by_goals


def test_what_an_editor_reads_of_a_scene_is_left_out(tmp_path):
    text = write_scene("PushBlock", tmp_path / "push.yaml").read_text()
    assert "yaml-language-server" in text
    told = task_source(task_of(tmp_path, text, "none"))
    assert "yaml-language-server" not in told
    assert "bodies:" in told
