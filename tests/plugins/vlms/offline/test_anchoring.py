"""The embedded designer's anchored plans: they mean what was computed, and move with the layout."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from core.designs.planning import look
from core.designs.reading import read_designs
from core.interfaces import Brief, Perception, Request, RolloutSettings
from core.plugins import installed
from core.robot.kinematics import arm_of
from plugins.actions.anchored import AnchoredActions
from plugins.actions.waypoints import WaypointActions
from plugins.conformance.evaluations import tried_once
from plugins.vlms.offline.answer import answer
from plugins.vlms.offline.designer import OfflineDesigner
from plugins.vlms.offline.faults import reach_error
from plugins.vlms.offline.parents import find_parents
from tests.panda import on_panda
from tests.playing import evaluate_batch
from tests.rare import rare

pytestmark = pytest.mark.slow

URDF, GIVEN = (installed().create("tool", name) for name in ("urdf", "none"))


def brief(name, variation="none", actions=None, **more):
    task = on_panda(installed().create("task", name, variation=variation))
    settings = {
        "gripper": False,
        "n_tool": 1,
        "n_action": 2,
        "generation": 0,
        "agent": 0,
        "seed": 7,
    } | more
    return Brief(task, 0, URDF, actions=actions or AnchoredActions(), **settings)


def candidates(given, document):
    return read_designs(
        document, URDF, given.task, actions=given.actions, most=(None, given.n_action)
    )


TASKS = (
    "BringCube",
    "ElevatePlate",
    "HighObject",
    "LiftBox",
    "OneBook",
    "ScoreGoal",
    "SnatchCookie",
    "TurkeyLegs",
)


@pytest.mark.parametrize("name", rare(TASKS, "BringCube", "SnatchCookie"))
def test_in_its_own_layout_a_plan_is_the_literal_one(name):
    given = brief(name)
    document = answer(given)
    literal = answer(replace(given, actions=WaypointActions()))["strategies"][0][
        "action_sets"
    ]
    seen = look(given.task, 0, Perception())
    for data, rows in zip(
        document["strategies"][0]["action_sets"], literal, strict=True
    ):
        plan = given.actions.parse(data, gripper=False)
        np.testing.assert_allclose(
            plan.resolve(seen).poses[:, :3], np.array(rows)[:, :3], atol=1e-4
        )
        assert {anchor.name for anchor in plan.anchors} - {"world"}


def test_offspring_of_what_flew_away_can_be_written():
    """By the measure of what is missing, some strokes would get 60 m longer, and no step leads as far."""
    given = brief("BringCube")
    (first, *_) = candidates(given, answer(given))
    flown = (tried_once(first, "ok", 0.1, moved_m={"cube": 60.0}),)
    offspring = replace(
        given, elites=flown, n_tool=4, n_action=3, actions=AnchoredActions(), seed=8
    )
    assert len(answer(offspring)["strategies"]) == 4


def feeling(name, **more):
    given = brief(name, "wide", AnchoredActions(guards=True), **more)
    return given, [
        c
        for c in candidates(given, answer(given))
        if any(step.until for step in c.plan.steps)
    ]


def test_every_other_plan_feels_for_the_ground():
    _, found = feeling("ElevatePlate", n_tool=3, n_action=4)
    assert len(found) == 6
    for step in (step for c in found for step in c.plan.steps if step.until):
        assert (step.until, step.corrects) == ("touch", ("plate",))


def test_the_bare_hand_feels_for_nothing():
    given = replace(
        brief("BringCube", actions=AnchoredActions(guards=True)), representation=GIVEN
    )
    plans = answer(given)["strategies"][0]["action_sets"]
    assert len(plans) == 2
    assert not any("until" in step for plan in plans for step in plan)


@pytest.mark.thorough
def test_what_feels_for_the_ground_minds_heights_less():
    given, found = feeling("ElevatePlate", n_tool=4)
    blind = [
        replace(
            c, plan=replace(c.plan, steps=tuple(s for s in c.plan.steps if not s.until))
        )
        for c in found
    ]
    sim = installed().create("sim", "mujoco")
    settings = RolloutSettings(perception=Perception(height=0.008))
    felt, missed = (
        [
            [e.reward for e in evaluate_batch(given.task, sim, tried, s, settings)]
            for s in (50, 51, 52)
        ]
        for tried in (found, blind)
    )
    assert np.mean(felt) > np.mean(missed) + 0.05


def test_offspring_of_a_plan_with_guards_have_one_at_most():
    given = brief("BringCube", actions=AnchoredActions(guards=True))
    (first, *_) = candidates(given, answer(given))
    steps = [
        *first.plan.dump(),
        {"anchor": "cube", "offset": [0, 0.1, 0.3], "until": "touch"},
    ]
    steps += [
        {"anchor": "here", "offset": [0, 0, 0.1]},
        {"anchor": "cube", "toward": "here", "offset": [0, 0, 0.1]},
    ]
    guarded = replace(first, plan=given.actions.parse(steps, gripper=False))
    elites = (tried_once(guarded, "ok", 0.9, moved_m={"cube": 0.3}),)
    offspring = replace(given, elites=elites, n_tool=2, n_action=3)
    plans = [c.plan for c in candidates(offspring, answer(offspring))]
    assert [sum(bool(step.until) for step in plan.steps) for plan in plans] == [
        1,
        0,
        1,
    ] * 2
    assert not any(
        "here" in (step.anchor, step.toward) for plan in plans for step in plan.steps
    )


@pytest.mark.thorough
def test_one_plan_lifts_a_plate_in_layouts_that_it_was_not_made_for():
    given = brief("ElevatePlate", "wide", AnchoredActions(), n_tool=3)
    sim = installed().create("sim", "mujoco")
    found = candidates(given, answer(given))
    rewards = [
        [e.reward for e in evaluate_batch(given.task, sim, found, s)]
        for s in (50, 51, 52)
    ]
    assert np.mean(rewards, axis=0).max() > 0.9


def test_tools_for_varied_layouts_reach_the_bodies_there():
    given = brief("BringCube", "wide", AnchoredActions(), n_tool=4, n_action=1)
    plans = [c.plan for c in candidates(given, answer(given))]
    arm = arm_of(given.task.robot)
    seen = [look(given.task, seed, Perception()) for seed in range(40, 46)]
    missed = [
        [reach_error(plan.resolve(one).poses, arm) > 0.005 for one in seen]
        for plan in plans
    ]
    assert np.mean(missed, axis=1).min() < 0.2


def test_every_other_plan_looks_and_is_done_again():
    given = brief("BringCube", actions=AnchoredActions(looks=True), n_action=4)
    found = candidates(given, answer(given))
    plain = candidates(given, answer(replace(given, actions=AnchoredActions())))
    seen = look(given.task, 0, Perception())

    assert [c.plan.looks for c in found] == [True, False, True, False]
    for looking, once in zip(found, plain, strict=True):
        parents = find_parents([tried_once(looking, "ok", 0.9)], False, seen)
        rows = parents[0].rows
        count = len(once.plan.steps)
        np.testing.assert_array_equal(rows[:count], once.plan.resolve(seen).poses)
        if looking.plan.looks:
            (block,) = looking.plan.dump()
            assert block["until_seen"] == {"goal": 0}
            assert block["repeat"][-1] == {"look": True}
            assert rows[-1, 2] > rows[:, 2].min() + 0.07  # the arm hides less


def test_with_a_camera_in_the_hand_a_plan_looks_before_its_tool_comes_down():
    given = brief("BringCube", actions=AnchoredActions(looks=True), n_tool=4)
    seen = look(given.task, 0, Perception())
    found = candidates(given, answer(given, looks_near=True))
    plain = candidates(given, answer(given))
    looking = 0

    for candidate, loop in zip(found, plain, strict=True):
        if not candidate.plan.looks:
            continue

        (block,) = candidate.plan.dump()
        steps = block["repeat"]
        near = steps.index({"look": True})
        if near < len(steps) - 1:
            looking += 1
            above = steps[near - 1]
            down = steps[near + 1]
            assert above["anchor"] == down["anchor"]
            assert above["offset"][2] > down["offset"][2] + 0.02
            del steps[near]

        assert [block] == loop.plan.dump()

        # What is bred from it knows what comes after that look, and one round.
        (parent,) = find_parents([tried_once(candidate, "ok", 0.9)], False, seen)
        (once,) = find_parents([tried_once(loop, "ok", 0.9)], False, seen)
        np.testing.assert_array_equal(parent.rows, once.rows)
        assert len(parent.rows) == len(steps) - 1

    assert looking >= 2


@pytest.mark.parametrize("camera", ["fixed", "hand"])
def test_the_designer_reads_where_the_camera_of_its_run_is(camera):
    given = brief("BringCube", actions=AnchoredActions(looks=True))
    settings = RolloutSettings(perception=Perception(camera=camera))
    run = SimpleNamespace(config={}, task=given.task, seed=0, settings=settings)
    designer = OfflineDesigner()
    designer.run_started(run)
    (reply,) = designer.complete([Request("r", given, (), {}, 1.0)])
    assert json.loads(reply.text) == answer(given, looks_near=camera == "hand")


def test_what_holds_bodies_up_does_not_go_down_again():
    given = brief("GatherSpheres", actions=AnchoredActions(looks=True), n_tool=2)
    found = [c for c in candidates(given, answer(given)) if c.plan.looks]
    assert found
    for candidate in found:
        (block,) = candidate.plan.dump()
        condition = block["until_seen"]
        assert condition["body"] == "sphere_*"
        assert condition["enough"] == 1
        assert 0.1 < condition["above"] < 0.3


def test_scattered_bodies_are_moved_as_they_are_seen_one_by_one():
    """Offspring of such a plan stand by the bodies, too."""
    given = brief("CleanTable", "wide", AnchoredActions(looks=True), n_tool=4, seed=0)
    found = [c for c in candidates(given, answer(given)) if c.plan.looks]
    each = [c for c in found if "each" in c.plan.dump()[0]["repeat"][0]]
    assert each

    seen = look(given.task, 0, Perception())
    block = each[0].plan.dump()[0]["repeat"][0]
    bodies = seen.judge.names(0)
    assert {*seen.judge.left(0, seen.poses)} <= {*bodies}
    assert {step.get("anchor", "it") for step in block["do"]} == {"it"}
    (parent,) = find_parents([tried_once(each[0], "ok", 0.9)], False, seen)
    names = {anchor.name for anchor in parent.anchors}
    assert names == {*seen.judge.left(0, seen.poses)}

    elites = (tried_once(each[0], "ok", 0.9),)
    offspring = replace(given, elites=elites, n_tool=1)
    (first, _) = candidates(offspring, answer(offspring))
    assert first.problem is None
    assert {anchor.name for anchor in first.plan.find_anchors(seen)} <= {*bodies}


def test_what_a_gripper_holds_is_not_done_again():
    given = brief("LiftBox", actions=AnchoredActions(looks=True), gripper=True)
    assert not any(c.plan.looks for c in candidates(given, answer(given)))
    without = replace(given, gripper=False)
    assert any(c.plan.looks for c in candidates(without, answer(without)))
