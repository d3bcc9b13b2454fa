"""Runs that try the tools of a library before they ask a model."""

import json

import pytest

from core.config.compose import load, part, task_part, tool_part
from core.design import Component, Tool
from core.errors import UsageError, UserError
from core.geometry import Box, Pose
from core.plugins import MODEL, event_hub
from core.search.builder import build_designer
from core.search.orchestration import run
from core.search.setup import build_search
from core.store.reader import StoredRun
from plugins.results.toolbox.toolbox_command import main as toolbox
from tests.core.run_folders import hook, write_run
from tests.support.scene_files import SCENES
from tests.support.text import replaced_all

LONG_POST = Tool(
    (
        Component(
            "post",
            "tool_mount",
            Pose.xyz_rpy((0, 0, -0.3), (0, 0, 0)),
            Box((0.02, 0.02, 0.6)),
        ),
    ),
    name="long post",
)
SMALL = [
    "task=BringCube",
    "sim=mujoco",
    "rollout.hold_s=0.2",
    "prompt.picture=false",
    "prompt.repair=0",
    "budget=tiny",
    "budget.reward_save=-1",
    "listener=[]",
    "film=false",
]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """Two tools: one that does for BringCube, and one that starts inside of its table."""
    root = tmp_path_factory.mktemp("library")
    write_run(root / "runs/a", "task=MoveBall", rewards=[[0.9]], tools=[hook(0.2)])
    write_run(root / "runs/b", "task=HighObject", rewards=[[0.9]], tools=[LONG_POST])
    toolbox(["add", str(root / "runs"), f"output={root / 'library'}"])
    return root / "library"


def search(*words):
    """Build a search, as a run does before it begins."""
    return build_search(load("config", [*SMALL, *words]), None, {})


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_known_tools_are_tried_first_and_are_what_the_model_evolves(library, tmp_path):
    answer = tmp_path / "answer.json"
    file = next(library.glob("hook*/design.json"))
    answer.write_text(file.read_text())
    words = ["tool=known", f"tool.library={library}", "budget.n_iteration=1"]
    model = ["vlm=command", f"vlm.command=[cat,{answer}]"]
    run(load("config", [*SMALL, *words, *model]), tmp_path / "run")
    stored = StoredRun(tmp_path / "run")
    tried = {row.candidate: row for row in stored.evaluations()}
    assert list(tried) == ["g0-a0-s0-p0", "g0-a0-s1-p0", "g0-a1-s0-p0", "g1-a0-s0-p0"]
    kept, planned, refused, asked = tried.values()
    # Its own plan, and one that the embedded designer made for this task.
    assert kept.content == asked.content != planned.content
    assert refused.status == "rejected"
    assert "component 'post' starts" in refused.reason
    models = {request.id: reply.model for request, reply in stored.answers()}
    assert models["g0-a0"].startswith("offline")
    assert list(models) == ["g0-a0", "g1-a0"]
    (request,) = (found for found in stored.requests() if found.id == "g1-a0")
    assert request.elites
    assert set(request.elites) <= {"g0-a0-s0-p0", "g0-a0-s1-p0"}
    # The winner is read as any other: in the form in which the run's tools are written.
    toolbox(["add", str(tmp_path / "run"), f"output={tmp_path / 'again'}"])
    (facts,) = (tmp_path / "again").glob("*/tool.json")
    assert json.loads(facts.read_text())["config"]["tool"]["library"] == str(library)


def test_tools_of_another_form_are_written_anew(tmp_path):
    write_run(tmp_path / "run", "task=MoveBall", "tool=boxes", rewards=[[0.9]])
    toolbox(["add", str(tmp_path / "run"), f"output={tmp_path / 'library'}"])
    words = ["tool=known", f"tool.library={tmp_path / 'library'}"]
    contents = set()
    for form in ("boxes", "urdf"):
        cfg = load("config", [*SMALL, *words, f"tool.of={form}"])
        task = task_part(cfg).create()
        tools = tool_part(cfg).create()
        (candidate,) = tools.kept(task)
        assert candidate.problem is None
        contents.add(candidate.tool.content)
        (field,) = tools.schema()
        assert field in json.loads(candidate.tool.written[1])
    assert len(contents) == 1


@pytest.mark.thorough
def test_mistakes_are_one_line(library, tmp_path):
    (tmp_path / "empty").mkdir()
    known = f"tool.library={library}"
    for words, said in (
        ([f"tool.library={tmp_path / 'no'}"], "there is no such folder; keep tools"),
        ([f"tool.library={tmp_path / 'empty'}"], "holds no tool; keep tools"),
        ([known, "tool.file=a.json"], "leave one of them away"),
        ([known, "tool.of=none"], "tool.of=none gives a tool"),
        ([], "tool=known needs tools"),
        ([known, "task=multitask", "task.of=[BringCube,MoveBall]"], "on one task"),
    ):
        with pytest.raises(UserError, match=said):
            search("tool=known", *words)


@pytest.mark.thorough
def test_a_model_that_is_told_no_numbers_gets_none_by_a_plan(library):
    words = ["tool=known", f"tool.library={library}", "prompt.context=pictures"]
    cfg = load("config", [*SMALL, *words, "vlm=mailbox"])
    with pytest.raises(UsageError, match=r"prompt\.context=pictures holds these back"):
        build_designer(cfg, part(MODEL, cfg.vlm).create(), event_hub())


@pytest.mark.slow
def test_kept_tools_without_the_fixture_that_goals_name_are_refused(library, tmp_path):
    (funnel,) = [scene for scene in SCENES if scene.stem == "UseFunnel"]
    file = tmp_path / "named.yaml"
    file.write_text(
        replaced_all(funnel.read_text(), ("inside: bottle", "inside: fixture"))
    )
    words = ["tool=known", f"tool.library={library}", "task=file", f"task.file={file}"]
    cfg = load("config", [*SMALL[1:], *words])
    designer, _ = build_designer(cfg, part(MODEL, cfg.vlm).create(), event_hub())
    problems = [candidate.problem for candidate in designer.first_tools.design()]
    assert len(problems) == 2
    for problem in problems:
        assert "the goals of UseFunnel name the fixture, and the design has" in problem
