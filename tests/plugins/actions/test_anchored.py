import json
import math
import pickle
import re
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.config.compose import load, tool_part
from core.design import Candidate, Component, DesignError, Tool
from core.designs.reading import dump_design, load_designs, read_designs
from core.geometry import Box, Pose
from core.interfaces import Anchor, RolloutSettings, Seen, Simulator, Waypoints
from core.plugins import installed
from core.robot.trajectory import plan_task_motion
from core.search.orchestration import resume, run
from plugins.actions.anchored import AnchoredActions, AnchoredPlan
from plugins.actions.waypoints import WaypointActions
from plugins.results.chosen import stored_evaluations
from plugins.results.pages.best_tool import best_tool
from plugins.results.pages.runs import read_run
from tasks.bring_cube import BringCube
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch
from tests.support.refusing import refused

ACTIONS = AnchoredActions()
CUBE = Pose.xyz_rpy((0.6, 0.1, 0.02), (0.0, 0.0, 0.5))
SEEN = Seen({"cube": CUBE, "goal": Pose.xyz_rpy((0.6, -0.3, 0.0))})


def plan(*steps, gripper=False):
    return ACTIONS.parse(list(steps), gripper=gripper)


def first(*steps, **how):
    return plan(*steps, **how).resolve(SEEN).poses[0]


def test_by_default_the_axes_are_the_worlds():
    np.testing.assert_allclose(first({"offset": [0.5, 0, 0.4]}), [0.5, 0, 0.4, 0, 0, 0])
    np.testing.assert_allclose(
        first({"anchor": "cube", "offset": [0, 0, 0.1]}), [0.6, 0.1, 0.12, 0, 0, 0]
    )


def test_the_anchors_axes_turn_with_it():
    row = first(
        {"anchor": "cube", "axes": "anchor", "offset": [0.1, 0, 0], "rpy": [0, 0, 0.2]}
    )
    np.testing.assert_allclose(row[:3], CUBE.apply(np.array([0.1, 0, 0])))
    np.testing.assert_allclose(row[3:], [0, 0, 0.7], atol=1e-12)


def test_toward_turns_x_to_the_other_anchor():
    row = first({"anchor": "cube", "toward": "goal", "offset": [0.1, 0, 0.3]})
    np.testing.assert_allclose(row, [0.6, 0.0, 0.32, 0, 0, -np.pi / 2], atol=1e-12)


@given(
    st.floats(-3, 3),
    st.floats(-0.2, 0.2),
    st.floats(-0.2, 0.2),
    st.sampled_from(["anchor", "toward"]),
)
def test_a_plan_moves_with_the_scene(yaw, x, y, how):
    """Turned and moved as a whole, the scene's plan is the same motion in its own frame."""
    move = Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, yaw))
    where = {"axes": "anchor"} if how == "anchor" else {"toward": "goal"}
    step = {
        "anchor": "cube",
        "offset": [0.05, -0.03, 0.1],
        "rpy": [0.1, 0.2, 0.3],
        **where,
    }
    there = Seen({name: move @ pose for name, pose in SEEN.poses.items()})
    before, after = (plan(step).resolve(seen).poses[0] for seen in (SEEN, there))
    np.testing.assert_allclose(move.apply(before[:3]), after[:3], atol=1e-9)
    turned = move.rotation * Rotation.from_euler("xyz", before[3:])
    assert (turned.inv() * Rotation.from_euler("xyz", after[3:])).magnitude() < 1e-7


ANCHORS = [
    Anchor(),
    Anchor("cube"),
    Anchor("goal", axes="anchor"),
    Anchor("cube", toward="goal", share=0.3),
    Anchor("world", toward="cube"),
    Anchor("cube", "anchor", "goal", 0.7),
]


@given(
    st.lists(
        st.tuples(*[st.floats(-1, 1)] * 3, *[st.floats(-3, 3)] * 3, st.floats(0, 1)),
        min_size=6,
        max_size=6,
    ),
    st.permutations(ANCHORS),
    st.booleans(),
)
def test_anchored_waypoints_are_the_same_ones_in_their_layout(rows, anchors, gripper):
    literal = Waypoints(np.array(rows)[:, : 7 if gripper else 6])
    read = ACTIONS.parse(
        json.loads(json.dumps(ACTIONS.anchor(literal, anchors, SEEN))), gripper=gripper
    )
    resolved = read.resolve(SEEN)
    assert read.anchors == tuple(anchors)
    np.testing.assert_allclose(resolved.poses[:, :3], literal.poses[:, :3], atol=1e-4)
    np.testing.assert_array_equal(resolved.grips, literal.grips)
    before, after = (
        Rotation.from_euler("xyz", plan.poses[:, 3:6]) for plan in (literal, resolved)
    )
    assert (before.inv() * after).magnitude().max() < 1e-4


def test_a_representation_without_anchors_writes_literal_waypoints():
    literal = Waypoints(np.array([[0.5, 0, 0.4, 0, 0, 0]]))
    assert WaypointActions().anchor(literal, [Anchor("cube")], SEEN) == literal.dump()
    assert literal.anchors == ()


def test_tempo_comes_along():
    steps = [
        {"offset": [0.5, 0, 0.4], "speed": 0.5, "through": True},
        {"offset": [0.5, 0, 0.3], "seconds": 2, "wait": 1},
    ]
    tempo = plan(*steps).resolve(SEEN).tempo
    np.testing.assert_array_equal(tempo.speeds, [0.5, np.nan])
    np.testing.assert_array_equal(tempo.seconds, [np.nan, 2])
    np.testing.assert_array_equal(tempo.through, [True, False])
    np.testing.assert_array_equal(tempo.waits, [0, 1])
    assert plan({"offset": [0.5, 0, 0.4]}).resolve(SEEN).tempo is None


def test_the_gripper_is_the_seventh_number():
    assert first({"offset": [0.5, 0, 0.4], "grip": 0.5}, gripper=True)[6] == 0.5


GOOD = {"offset": [0.5, 0.0, 0.4]}


def test_the_axes_may_be_those_of_a_third_body():
    """The cube is turned by a quarter of a circle: x of the offset is along the world's y."""
    turned = Pose.xyz_rpy((0.9, 0.9, 0.0), (0.0, 0.0, np.pi / 2))
    known = Seen({**SEEN.poses, "cube": turned})
    step = {"anchor": "goal", "axes": "cube", "offset": [0.1, 0.0, 0.3]}
    (row,) = plan(step).resolve(known).poses
    np.testing.assert_allclose(row[:3], [0.6, -0.2, 0.3], atol=1e-9)
    np.testing.assert_allclose(row[3:], [0.0, 0.0, np.pi / 2], atol=1e-9)
    with pytest.raises(DesignError, match="no anchor 'cub'"):
        plan({**step, "axes": "cub"}).resolve(known)


@pytest.mark.parametrize(
    ("step", "code"),
    [
        ({"axes": 3}, "E_ENTRY_TEXT"),
        ({"through": "yes"}, "E_ENTRY_WORD"),
        ({"offset": [0.5, 0, "0.4"]}, "E_ENTRY_NUMBER"),
        ({"speed": math.inf}, "E_ENTRY_RANGE"),
    ],
)
def test_what_replies_mend_is_refused(step, code):
    with refused(code):
        plan(GOOD | step)


@pytest.mark.parametrize(
    ("step", "problem"),
    [
        ({"anchor": "cub"}, "waypoint 1: no anchor 'cub'; possible: cube, goal, world"),
        ({"toward": "gaol"}, "waypoint 1: no anchor 'gaol'"),
        ({"anchor": "cube", "toward": "cube"}, "there is no direction"),
    ],
)
def test_an_anchor_that_is_not_there(step, problem):
    with pytest.raises(DesignError, match=problem):
        plan(GOOD | step).resolve(SEEN)


def test_an_anchor_is_found_whatever_its_case():
    written = plan(GOOD | {"anchor": "Cube"}, GOOD | {"anchor": "World"})
    wanted = plan(GOOD | {"anchor": "cube"}, GOOD)
    assert written.resolve(SEEN) == wanted.resolve(SEEN)


def test_a_designs_file_names_the_representation_and_reads_back():
    task = on_panda(BringCube())
    bare = installed().create("tool", "none")

    def read(**fields):
        document = json.loads(json.dumps({"strategies": [BARE | fields]}))
        (candidate,) = read_designs(document, bare, task)
        return candidate

    candidate = read(action="anchored", action_sets=[[GOOD, NEAR]])
    assert isinstance(candidate.plan, AnchoredPlan)
    again = read(**dump_design(candidate, bare))
    assert (
        again.content
        == candidate.content
        == pickle.loads(pickle.dumps(candidate)).content
    )
    numbers = 7 if bare.given(task).gripper else 6
    literal = read(action_sets=[[[0.5, 0, 0.4, 0, 0, 0, 1][:numbers]]])
    assert isinstance(literal.plan, Waypoints)
    assert "action" not in dump_design(literal, bare)
    assert "no action 'dance'" in read(action="dance", action_sets=[[GOOD]]).problem


BARE = {"strategy_name": "bare"}
NEAR = {"anchor": "cube", "offset": [0.0, 0.0, 0.2], "speed": 5.0}


def test_it_is_played_and_what_was_slowed_is_reported():
    task = on_panda(BringCube())
    candidates = [
        Candidate(installed().create("tool", "none").given(task), plan(*steps))
        for steps in ([GOOD, NEAR], [GOOD | {"anchor": "nowhere"}])
    ]
    played, lost = evaluate_batch(task, installed().create("sim", "mujoco"), candidates)
    assert played.status == "ok"
    assert any("waypoint 2: the arm's limits" in warning for warning in played.warnings)
    assert (lost.status, "no anchor 'nowhere'" in lost.reason) == ("rejected", True)


class Never(Simulator):
    """A simulator that is not to be called."""

    def rollout(self, task, jobs):
        assert not jobs
        return []

    def render(self, task, **view):
        raise AssertionError("it is not to draw")


# Close above the table: what swings far from all bodies is not looked at more often.
SWING = [{"offset": [0.5, 0.3 * (-1) ** k, 0.04], "speed": 5.0} for k in range(60)]


@pytest.mark.parametrize(
    ("steps", "reason"),
    [
        ([GOOD | {"speed": 1e-6}], "waypoint 1: a speed of 1e-06 is too small"),
        ([GOOD | {"seconds": 5e-324}], "waypoint 1: a time of"),
        (
            [
                GOOD | {"rpy": [0, 0, 3.0 * (k % 2)], "through": k < 198}
                for k in range(199)
            ],
            "and 594 rad long; at most",
        ),
        ([GOOD | {"wait": 60}] * 3, "the plan asks for 180 s; at most 120 s"),
        (
            SWING,
            "99 parts would be looked at 1600 times a second for 4[0-9] s, .* at most 2e[+]06 are computed",
        ),
    ],
)
def test_what_would_cost_too_much_is_refused_before_it_is_spent(steps, reason):
    sheet = Component("c", "tool_mount", Pose(), Box((0.0005, 0.02, 0.02)), 0.0005)
    sheets = [
        replace(sheet, name=f"c{k}", pose=Pose.xyz_rpy((0.0002 * k, 0.0, -0.01)))
        for k in range(99)
    ]
    began = time.process_time()
    (lost,) = evaluate_batch(
        on_panda(BringCube()),
        Never(),
        [Candidate(Tool(tuple(sheets)), plan(*steps))],
    )
    assert lost.status == "rejected"
    assert re.search(reason, lost.reason)
    assert time.process_time() - began < 20.0


def test_a_hundred_warnings_are_a_line():
    steps = [{"offset": [0.5, 0.05 * (-1) ** k, 0.4], "speed": 5.0} for k in range(20)]
    slowed = plan_task_motion(
        plan(*steps).resolve(SEEN), on_panda(BringCube()), RolloutSettings()
    ).slowdowns()
    assert len(slowed) == 1
    assert re.search(
        r"waypoint 1, 2, 3 and \d+ more: the arm's limits .* up to \d+\.\d times slower than asked",
        slowed[0],
    )


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
@pytest.mark.thorough
def test_a_run_is_stored_and_goes_on_with_its_plans_as_written(tmp_path):
    words = [
        *("budget=tiny", "budget.n_action=2"),
        *("budget.n_iteration=0", "listener=[]", "film=false", "prompt.picture=false"),
        *("sim=mujoco", "action=anchored", "rollout.perception.position=0.005"),
    ]
    cfg = load("config", words)
    run(cfg, tmp_path / "run")
    representation = tool_part(cfg).create()
    task = on_panda(BringCube())
    stored = stored_evaluations(tmp_path / "run", representation, task)
    stored = {tried.candidate.id: tried.candidate.plan for tried in stored}
    assert all(isinstance(plan, AnchoredPlan) for plan in stored.values())
    winner = best_tool(read_run(tmp_path / "run"))
    (design,) = load_designs(tmp_path / "run/best/design.json")["strategies"]
    assert design["action"] == "anchored"
    assert design["action_sets"] == [stored[winner.run.best.candidate].dump()]
    resume(tmp_path / "run", ["budget.n_iteration=1"])
    assert (
        len(json.loads((tmp_path / "run/result.json").read_text())["generations"]) == 2
    )


GUARDED = {
    "anchor": "cube",
    "offset": [0, 0, 0.1],
    "until": "force",
    "newtons": 5,
    "otherwise": "end",
}
HERE = {"anchor": "here", "offset": [0, 0, 0.02]}
HOVER = {"anchor": "cube", "offset": [0, 0, 0.3]}


def test_here_is_where_the_last_guard_ended():
    steps = plan(GUARDED, HERE, GUARDED, HERE)
    nominal = steps.resolve(SEEN)
    np.testing.assert_allclose(
        nominal.poses[[1, 3], :3], nominal.poses[[0, 2], :3] + [0, 0, 0.02]
    )
    felt = Pose.xyz_rpy((0.5, 0.0, 0.3))
    again = steps.resolve(Seen(SEEN.poses, (None, felt)))
    np.testing.assert_allclose(again.poses[:3], nominal.poses[:3])
    np.testing.assert_allclose(again.poses[3, :3], [0.5, 0.0, 0.32])
    assert [guard and guard.newtons for guard in again.guards] == [5, None, 5, None]


FINDING = {
    "anchor": "cube",
    "offset": [0, 0, 0.1],
    "until": "touch",
    "corrects": ["cube", "goal"],
    "beyond": 0.02,
}


def test_a_touch_corrects_bodies_along_the_way_that_led_to_it():
    steps = plan(
        {"anchor": "cube", "offset": [0, 0, 0.3]},
        FINDING,
        *({"anchor": a, "offset": [0, 0, 0]} for a in ("cube", "goal", "world")),
    )
    nominal = steps.resolve(SEEN).poses
    # 5 mm lower than 2 cm above; aside counts for nothing.
    lower = Pose(nominal[1, :3] + [0.004, 0.003, 0.015])
    found = steps.resolve(Seen(SEEN.poses, (lower,))).poses
    shifts = found[:, :3] - nominal[:, :3]
    np.testing.assert_allclose(
        shifts, [[0] * 3, [0] * 3, [0, 0, -0.005], [0, 0, -0.005], [0] * 3], atol=1e-9
    )
    np.testing.assert_array_equal(
        steps.resolve(Seen(SEEN.poses, (None,))).poses, nominal
    )
    assert ACTIONS.parse(steps.dump(), gripper=False) == steps


def test_a_second_touch_corrects_what_the_first_has_corrected():
    aside = {**FINDING, "offset": [0.1, 0, 0.1]}
    steps = plan(
        {"anchor": "cube", "offset": [0, 0, 0.3]},
        FINDING,
        aside,
        {"anchor": "cube", "offset": [0, 0, 0]},
    )
    nominal = steps.resolve(SEEN).poses
    first = Pose(nominal[1, :3] + [0, 0, 0.03])
    between = steps.resolve(Seen(SEEN.poses, (first,))).poses
    second = Pose(between[2, :3] - [0.03, 0, 0])
    way = between[2, :3] - between[1, :3]
    shift = 0.02 * way / np.linalg.norm(way) + (
        second.position - between[2, :3]
    ) @ way * way / (way @ way)
    found = steps.resolve(Seen(SEEN.poses, (first, second))).poses
    np.testing.assert_allclose(
        found[3, :3], nominal[3, :3] + [0, 0, 0.01] + shift, atol=1e-9
    )


def test_a_plan_with_guards_is_written_as_it_is_read():
    steps = plan(GUARDED, HERE)
    assert ACTIONS.parse(steps.dump(), gripper=False) == steps
    waypoints = steps.resolve(SEEN)
    written = ACTIONS.anchor(waypoints, steps.anchors, SEEN)
    again = ACTIONS.parse(written, gripper=False).resolve(SEEN)
    np.testing.assert_allclose(again.poses, waypoints.poses, atol=2e-5)
    assert again.guards == waypoints.guards


def test_the_model_hears_of_guards_only_where_it_may_use_them():
    told = AnchoredActions(guards=True)
    silent = AnchoredActions()
    assert {"until", "newtons", "otherwise"} <= {
        *told.schema(gripper=False)["items"]["properties"]
    }
    assert "until" not in silent.schema(gripper=False)["items"]["properties"]
    brief = SimpleNamespace(task=BringCube(), scene_seed=0, gripper=False, closes=False)
    assert "`until`" in told.instructions(brief)
    assert "`until`" not in silent.instructions(brief)
