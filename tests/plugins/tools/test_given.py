"""The bare gripper and the given tools, for which only plans are designed."""

import numpy as np
import pytest

from core.config.compose import load, tool_part
from core.design import RIGID_MOUNT, Tool
from core.designs.composer import PromptComposer
from core.designs.reading import dump_design, load_designs, read_designs
from core.designs.schema import answer_schema
from core.designs.start import SpawnRules
from core.errors import UsageError, UserError
from core.interfaces import Brief, Text
from core.plugins import installed
from plugins.actions.waypoints import WaypointActions
from plugins.tools.given import _RLBENCH, _RLBENCH_TASKS
from tasks.bring_cube import BringCube
from tasks.one_book import OneBook
from tests.support.panda import on_panda
from tests.support.solutions import FILES, anchored

NONE, RLBENCH = (installed().create("tool", name) for name in ("none", "rlbench"))


def test_stick_is_as_in_the_paper():
    (component,) = RLBENCH.given(on_panda(BringCube())).components
    mount, pose = RLBENCH.given(on_panda(BringCube())).placed()["stick"]
    assert mount == RIGID_MOUNT
    assert component.shape.size[0] == pytest.approx(0.4, abs=0.03)
    np.testing.assert_allclose(pose.position, [0.2, 0.0, -0.1], atol=0.02)
    SpawnRules(on_panda(BringCube()), 0).check(RLBENCH.given(on_panda(BringCube())))


def test_each_task_has_its_own_tool_of_rlbench():
    names = [
        strategy["strategy_name"] for strategy in load_designs(_RLBENCH)["strategies"]
    ]
    assert names == list(_RLBENCH_TASKS)


def test_the_error_names_the_tasks_with_a_given_tool():
    with pytest.raises(
        UsageError, match=r"OneBook.*BringCube, CleanTable, GatherSpheres, ScoreGoal"
    ):
        RLBENCH.given(OneBook())


@pytest.mark.parametrize(("representation", "numbers"), [(NONE, 7), (RLBENCH, 6)])
def test_a_document_holds_plans_only(representation, numbers):
    task = on_panda(BringCube())
    plan = [[0.5, 0.0, 0.4, 0.0, 0.0, 0.0, 0.5][:numbers]]
    (candidate,) = read_designs(
        {"strategies": [{"action_sets": [plan]}]}, representation, task
    )
    assert candidate.problem is None
    assert candidate.tool.components == representation.given(task).components
    (again,) = read_designs(
        {"strategies": [dump_design(candidate, representation)]}, representation, task
    )
    np.testing.assert_array_equal(again.plan.poses, candidate.plan.poses)
    # The tool is given: what the document says of the gripper does not count.
    (same,) = read_designs(
        {"strategies": [{"gripper": numbers == 6, "action_sets": [plan]}]},
        representation,
        task,
    )
    assert same.problem is None
    assert same.tool.gripper == candidate.tool.gripper


@pytest.mark.parametrize(
    ("representation", "words"),
    [(NONE, "nothing but its two-finger gripper"), (RLBENCH, "stick")],
)
def test_prompt_asks_for_plans_only(representation, words):
    task = on_panda(BringCube())
    brief = Brief(
        task,
        0,
        representation,
        representation.given(task).gripper,
        1,
        10,
        0,
        0,
        0,
        actions=WaypointActions(),
    )
    user = PromptComposer().compose(brief)[-1]
    text = "".join(part.text for part in user.parts if isinstance(part, Text))
    assert words in text
    assert "tool_urdf" not in text
    assert "Spawn rules" not in text
    fields = answer_schema(brief)["properties"]["strategies"]["items"]["properties"]
    assert set(fields) == {
        "strategy_name",
        "strategy_description",
        "gripper",
        "action_description",
        "action_sets",
    }


def test_bare_gripper_is_the_hand():
    assert NONE.given(on_panda(OneBook())) == Tool(
        gripper=True,
        name="bare gripper",
        description="the gripper of Franka Panda, with its fingers",
    )


@pytest.mark.parametrize("material", ["paper", "pla"])
def test_the_tool_of_a_file_is_the_one_that_its_design_means(material):
    words = [f"tool.file={FILES['BringCube']}", "tool.of=boxes", f"material={material}"]
    known = (
        tool_part(load("config", ["tool=known", *words]))
        .create()
        .given(on_panda(BringCube()))
    )
    meant = anchored("BringCube", material).tool
    assert (known, known.mass, known.name) == (meant, meant.mass, meant.name)


@pytest.mark.parametrize(
    "document", ['{"strategies": [5]}', '{"strategies": [{"tool_components": 3}]}']
)
def test_a_file_without_a_tool_is_refused(tmp_path, document):
    file = tmp_path / "designs.json"
    file.write_text(document)
    with pytest.raises(
        UserError, match=r"designs\.json: the tool of design 0 can't be read"
    ):
        installed().create("tool", "known", {"file": str(file), "of": "boxes"}).given(
            BringCube()
        )
