"""Try what the embedded designer makes with one way of using a tool."""

from __future__ import annotations

from pathlib import Path

from core.design import Candidate
from core.designs.reading import read_designs
from core.interfaces import Brief, Task
from core.plugins import installed
from core.values.plans import NO_PLAN
from plugins.actions.waypoints import WaypointActions
from plugins.tasks.file.task import FileTask
from plugins.vlms.offline.search import NothingSuits, Search
from plugins.vlms.offline.writing import write_design
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch


def read_task(folder: Path, bodies: str, goals: str) -> Task:
    """Make a task of some bodies and goals, as a file has them."""
    file = folder / "scene.yaml"
    words = "name: Moved\ndescription: Something has to get somewhere.\n"
    file.write_text(f"{words}bodies:{bodies}goals:{goals}")
    return on_panda(FileTask(str(file)))


def make_brief(task: Task, gripper: bool = False, tool: str = "urdf") -> Brief:
    """Ask for one tool with one plan."""
    representation = installed().create("tool", tool)
    actions = WaypointActions()
    return Brief(task, 0, representation, gripper, 1, 1, 0, 0, 7, (), actions=actions)


def list_ways(brief: Brief) -> set[str]:
    """Name the ways that suit."""
    try:
        return {option.way.name for option in Search(brief).options}
    except NothingSuits:
        return set()


def earn(brief: Brief, way: str, count: int) -> list[float]:
    """Make designs with a way, and try them in MuJoCo."""
    search = Search(brief)
    search.options = [option for option in search.options if option.way.name == way]
    candidates = []
    for number in range(count):
        document = write_design([search.invent()], brief, search.layout, [])
        base = Candidate(None, NO_PLAN, agent=number)
        candidates += read_designs(
            {"strategies": [document]}, brief.representation, brief.task, base=base
        )

    mujoco = installed().create("sim", "mujoco")
    return [tried.reward for tried in evaluate_batch(brief.task, mujoco, candidates)]
