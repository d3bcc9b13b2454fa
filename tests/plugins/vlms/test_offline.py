"""The embedded designer: valid, independent of names, reproducible, evolving and useful."""

import json
import re
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from core.design import Candidate, Evaluation
from core.designs.composer import answer_schema
from core.designs.reading import parse_reply, read_designs
from core.designs.rules import SpawnRules
from core.geometry import Box, Cylinder, Pose, Sphere
from core.interfaces import Brief, Material, Request, Task
from core.plugins import installed
from core.robot.trajectory import plan_motion
from core.scene import Body, Geom, Goal, Joint, Scene, floor, goals_reward, table
from core.simulation.rollout import RolloutSettings, evaluate_batch
from core.solids.self_collision import find_self_collision
from plugins.actions.waypoints import WaypointActions
from plugins.vlms.offline.designer import OfflineDesigner, left_out
from plugins.vlms.offline.guided import handles
from plugins.vlms.offline.scene_analysis import SceneAnalysis
from tasks.high_object import HighObject
from tasks.score_goal import ScoreGoal
from tests.panda import ARM, PANDA, on_panda
from tests.rare import rare

pytestmark = pytest.mark.slow

RED = (0.8, 0.2, 0.2, 1.0)
URDF = installed().create("tool", "urdf")


class CubeTask(Task):
    name = "Fetch"
    description = "A cube has to come nearer."
    goals: ClassVar = (Goal(("cube",), place=(0.6, 0.1, 0.035)),)

    def scene(self, seed):
        return Scene(
            (floor(), table(), Body.of("cube", Box((0.07, 0.07, 0.07)), (0.95, -0.1, 0.035), mass=1.0, color=RED))
        )

    def reward(self, start, end):
        def left(state):
            return np.abs(state.position("cube") - np.array(self.goals[0].place)).sum(axis=-1)

        return np.clip(1 - left(end) / left(start), 0.0, 1.0)


class RenamedCubeTask(CubeTask):
    name = "Other"
    description = "Quite another story."
    goals: ClassVar = (Goal(("solid",), place=(0.6, 0.1, 0.035)),)

    def scene(self, seed):
        ground, desk, cube = super().scene(seed).bodies
        return Scene((replace(ground, name="g"), replace(desk, name="d"), replace(cube, name="solid")))


class BallTask(CubeTask):
    goals: ClassVar = (Goal(("ball",), place=(0.6, -0.3, None)),)

    def scene(self, seed):
        ball = Body.of("ball", Sphere(0.08), (0.6, 0.3, 0.08), mass=1.0, color=RED)
        return Scene((floor(), table(), ball))


class SweepTask(CubeTask):
    goals: ClassVar = (Goal(tuple(f"crumb_{i}" for i in range(8)), place=(1.1, 0.0, None), tolerance=0.15),)

    def scene(self, seed):
        spots = np.random.default_rng(seed).permutation(
            [(0.5 + 0.09 * i, 0.1 * j) for i in range(4) for j in (-1, 0, 1)]
        )
        crumbs = (
            Body.of(f"crumb_{i}", Box((0.03, 0.03, 0.03)), (*spots[i], 0.015), mass=0.02, color=RED) for i in range(8)
        )
        return Scene((floor(), table(), *crumbs))


class PlateTask(CubeTask):
    goals: ClassVar = (Goal(("plate",), place=(0.75, 0.0, 0.4)),)

    def scene(self, seed):
        foot = Geom(Cylinder(0.07, 0.01), Pose(np.array([0.0, 0.0, 0.005])))
        rim = Geom(Cylinder(0.12, 0.006), Pose(np.array([0.0, 0.0, 0.015])))
        plate = Body("plate", Pose(np.array([0.75, 0.0, 0.0])), 0.5, (foot, rim), (foot, rim))
        return Scene((floor(), table(), plate))


class SlotTask(CubeTask):
    """Move the middle one of three upright boards away from its neighbours, which touch it."""

    goals: ClassVar = (Goal(("board_1",), away=0.15, keep=("board_0", "board_2")),)

    def scene(self, seed):
        boards = (
            Body.of(f"board_{i}", Box((0.25, 0.04, 0.17)), (0.6, 0.0405 * (i - 1), 0.085), mass=0.8, color=RED)
            for i in range(3)
        )
        return Scene((floor(), table(), *boards))


class ShelfTask(CubeTask):
    """Drop a cube from a board above the end-effector's home into a box in front of it."""

    goals: ClassVar = (Goal(("cube",), place=(0.85, 0.0, 0.03)),)

    def scene(self, seed):
        board = Body.of("board", Box((0.3, 0.8, 0.03)), (1.25, 0.0, 0.685), mass=0.0, color=RED)
        cube = Body.of("cube", Box((0.05, 0.05, 0.05)), (1.18, 0.0, 0.725), mass=0.1, color=RED)
        return Scene((floor(), table(), board, cube))

    def reward(self, start, end):
        cube = end.position("cube")
        return ((cube[..., 2] < 0.1) & (cube[..., 0] > 0.6) & (cube[..., 0] < 1.05)).astype(float)


def walls(name, length, width, height, *, mass, more=()):
    """A box without a lid, 5 mm thick, its frame below, in the middle."""
    x, y, z = (length - 0.005) / 2, (width - 0.005) / 2, (height + 0.005) / 2
    boxes = [
        ((length, width, 0.005), (0, 0, 0.0025)),
        *(((0.005, width, height - 0.005), (side * x, 0, z)) for side in (-1, 1)),
        *(((length - 0.01, 0.005, height - 0.005), (0, side * y, z)) for side in (-1, 1)),
        *more,
    ]
    parts = tuple(Geom(Box(size), Pose(np.array(at, dtype=float))) for size, at in boxes)
    return Body(name, Pose(), mass, parts, parts)


def at(body, x, y):
    return replace(body, pose=Pose(np.array([x, y, 0.0])))


class DeepTask(CubeTask):
    """Lift one of two stacked discs out of a deep box."""

    goals: ClassVar = (Goal(("lower", "upper"), place=(None, None, 0.35), any=True),)

    def scene(self, seed):
        discs = (
            Body.of(name, Cylinder(0.03, 0.03), (0.6, 0.0, height), mass=0.05, color=RED, friction=0.8)
            for name, height in (("lower", 0.0205), ("upper", 0.051))
        )
        return Scene((floor(), table(), at(walls("well", 0.2, 0.2, 0.2, mass=0.0), 0.6, 0.0), *discs))

    def reward(self, start, end):
        return np.clip(end.positions[..., 2].max(axis=-1) / 0.3, 0.0, 1.0)


class PanTask(CubeTask):
    """Bring dice from a loose pan with handles into a box."""

    goals: ClassVar = (Goal(("die_0", "die_1", "die_2"), place=(0.75, 0.25, 0.02), tolerance=0.1),)
    home = Pose(np.array([0.4, -0.2, 0.25]))

    def scene(self, seed):
        bars = [((0.07, 0.02, 0.008), (0, side * 0.11, 0.056)) for side in (-1, 1)]
        dice = (
            Body.of(f"die_{i}", Box((0.02, 0.02, 0.02)), (0.72 + 0.04 * i, -0.2, 0.0155), mass=0.02, color=RED)
            for i in range(3)
        )
        pan = at(walls("pan", 0.2, 0.2, 0.06, mass=0.5, more=bars), 0.76, -0.2)
        return Scene((floor(), table(), pan, at(walls("box", 0.4, 0.26, 0.08, mass=0.0), 0.75, 0.25), *dice))

    def reward(self, start, end):
        dice = np.stack([end.position(f"die_{i}") for i in range(3)], axis=-2)
        return (np.abs(dice - [0.75, 0.25, 0.04]) < [0.2, 0.13, 0.06]).all(axis=-1).mean(axis=-1)


TASKS = (CubeTask, BallTask, SweepTask, PlateTask, SlotTask, ShelfTask, DeepTask, PanTask)


def brief(task, *, gripper=False, n_tool=2, n_action=3, seed=7, elites=(), representation=URDF):
    task = on_panda(task)
    return Brief(
        task,
        0,
        representation,
        gripper,
        n_tool,
        n_action,
        1 if elites else 0,
        0,
        seed,
        tuple(elites),
        actions=WaypointActions(),
    )


def reply(given):
    request = Request("r", given, (), answer_schema(given), 1.0)
    (only,) = OfflineDesigner().complete([request])
    assert only.request_id == "r"
    assert only.error is None
    return only


def candidates(given):
    return read_designs(
        parse_reply(reply(given).text),
        given.representation,
        SpawnRules(given.task, 0),
        generation=given.generation,
        elites=tuple(elite.candidate.id for elite in given.elites),
    )


def elite(candidate, reward):
    return Evaluation(candidate, "ok", reward=reward, distance_m=1.0, moved_m={"cube": 0.3})


def numbers(candidate):
    tool = [(c.parent, c.pose.matrix.tolist(), c.shape.size) for c in candidate.tool.components]
    return tool, candidate.plan.poses.tolist()


def test_its_name_says_that_it_is_no_language_model():
    assert "no language model" in OfflineDesigner.model
    assert reply(brief(CubeTask())).model == OfflineDesigner.model
    assert isinstance(installed().create("vlm", "offline"), OfflineDesigner)


def analysis(task):
    return SceneAnalysis(brief(task))


def test_one_of_several_goals_is_chosen():
    class Choice(CubeTask):
        goals = (Goal(("cube",), place=(0.6, None, None)), Goal(("cube",), place=(None, 0.3, None)))

    shifts = [analysis(Choice()).subgoals(np.random.default_rng(seed)) for seed in range(12)]
    assert {len(subgoals) for subgoals in shifts} == {1}
    assert {int(np.argmax(np.abs(subgoals[0].shift))) for subgoals in shifts} == {0, 1}


def test_only_a_loose_body_holds_others_and_its_handles_are_measured():
    pan, cube, deep = (analysis(task()).subgoals(np.random.default_rng(0))[0] for task in (PanTask, CubeTask, DeepTask))
    assert [solid.position[2] for solid in deep.solids] == [0.051]  # the uppermost, if one is enough
    holder, heading, base = handles(pan)
    assert np.allclose(pan.holder.position, (0.76, -0.2, 0.0))
    assert (heading, base, holder.overhang(heading)[1].max()) == pytest.approx((0.0, 0.1, 0.12))
    assert deep.holder is cube.holder is handles(cube) is None


def test_a_detour_avoids_an_obstacle_above():
    class Roof(CubeTask):
        goals: ClassVar = (Goal(("cube",), place=(None, None, 0.4)),)

        def scene(self, seed):
            ground, desk, cube = super().scene(seed).bodies
            return Scene(
                (ground, desk, cube, Body.of("roof", Box((0.1, 0.5, 0.02)), (1.03, 0, 0.3), mass=0, color=RED))
            )

    (subgoal,) = analysis(Roof()).subgoals(np.random.default_rng(0))
    assert subgoal.blocked(subgoal.shift)
    assert subgoal.detour()[0] < -0.009
    assert not subgoal.blocked(subgoal.shift, subgoal.detour())
    (free,) = analysis(CubeTask()).subgoals(np.random.default_rng(0))
    assert not free.detour().any()


def test_high_bodies_are_reached_by_a_riser():
    for design in candidates(brief(ShelfTask(), n_tool=4, n_action=1)):
        names = [component.name for component in design.tool.components]
        assert "riser" in names
        assert design.plan.poses[-1, 2] < 0.75


def test_same_seed_same_reply():
    assert reply(brief(CubeTask())).text == reply(brief(CubeTask())).text
    assert reply(brief(CubeTask())).text != reply(brief(CubeTask(), seed=8)).text


@pytest.mark.parametrize(("n_tool", "n_action"), [(1, 1), (3, 2)])
def test_counts_and_fields_are_as_requested(n_tool, n_action):
    given = brief(CubeTask(), n_tool=n_tool, n_action=n_action)
    document = json.loads(reply(given).text)
    fields = answer_schema(given)["properties"]["strategies"]["items"]["required"]
    assert len(document["strategies"]) == n_tool
    for strategy in document["strategies"]:
        assert set(strategy) == set(fields)
        assert len(strategy["action_sets"]) == n_action


@pytest.mark.parametrize("gripper", [False, True])
@pytest.mark.parametrize("task", rare(TASKS, *TASKS[::3]))
def test_designs_keep_the_rules(task, gripper):
    designs = candidates(brief(task(), gripper=gripper, n_tool=8, n_action=2))
    assert len(designs) == 16
    assert sum(design.problem is not None for design in designs) <= 1, [design.problem for design in designs]
    assert all(design.plan.poses.shape[1] == (7 if gripper else 6) for design in designs if design.problem is None)


def test_long_forks_stay_clear_of_the_arm():
    """A large box is lifted by a fork that reaches back towards the shoulder."""
    task = installed().create("task", "LiftBox")
    designs = [design for design in candidates(brief(task, n_tool=4, n_action=2)) if design.problem is None]
    motions = [plan_motion(design.plan.poses, task.home, ARM) for design in designs]
    met = [find_self_collision(PANDA, d.tool, motion.trajectory) for d, motion in zip(designs, motions, strict=True)]
    assert len(met) >= 6
    assert sum(one is not None for one in met) <= 1, met


def test_fresh_designs_differ():
    designs = candidates(brief(CubeTask(), n_tool=6, n_action=3))
    assert len({json.dumps(numbers(design)) for design in designs}) == len(designs)
    assert len({json.dumps(numbers(design)[0]) for design in designs}) == 6


def test_names_make_no_difference():
    assert reply(brief(CubeTask())).text == reply(brief(RenamedCubeTask())).text


def test_offspring_differ_from_their_parents_and_name_them():
    parents = [replace(c, strategy=i) for i, c in enumerate(candidates(brief(CubeTask(), n_tool=3, n_action=1)))]
    elites = [elite(parent, 0.9 - 0.1 * i) for i, parent in enumerate(parents)]
    given = brief(CubeTask(), n_tool=8, n_action=3, seed=3, elites=elites)
    known = {parent.id: numbers(parent) for parent in parents}
    document = json.loads(reply(given).text)
    for strategy in document["strategies"]:
        assert 1 <= len(strategy["parents"]) <= 2
        assert set(strategy["parents"]) <= set(known)
        assert re.search("mutation|crossover", strategy["strategy_name"])
    children = candidates(given)
    assert sum(child.problem is not None for child in children) == 0
    for child in children:
        assert all(json.dumps(numbers(child)[0]) != json.dumps(tool) for tool, _ in known.values())
    assert any("crossover" in strategy["strategy_name"] for strategy in document["strategies"])


def test_elites_of_the_other_kind_are_not_remounted():
    (parent,) = candidates(brief(CubeTask(), n_tool=1, n_action=1))
    children = candidates(brief(CubeTask(), gripper=True, elites=[elite(parent, 0.9)]))
    assert all(child.tool.gripper and child.plan.poses.shape[1] == 7 for child in children)


def test_a_task_without_goals_gets_designs():
    class Aimless(CubeTask):
        goals = ()

    assert [design.problem for design in candidates(brief(Aimless(), n_tool=1, n_action=1))] == [None]


def test_a_scene_where_nothing_can_move_gets_an_error():
    class Bare(CubeTask):
        goals = ()

        def scene(self, seed):
            return Scene((floor(), table()))

    given = brief(Bare())
    (only,) = OfflineDesigner().complete([Request("r", given, (), {}, 1.0)])
    assert "no body that can move" in only.error
    assert only.text == ""


@pytest.mark.parametrize("name", ["none", "rlbench"])
def test_given_tools_get_plans_only(name):
    task = installed().create("task", "BringCube")
    representation = installed().create("tool", name)
    given = brief(task, representation=representation, gripper=representation.given(task).gripper, n_tool=1, n_action=4)
    document = json.loads(reply(given).text)
    assert set(document["strategies"][0]) == set(answer_schema(given)["properties"]["strategies"]["items"]["required"])
    designs = candidates(given)
    assert [design.problem for design in designs] == [None] * 4


def rewards(task, designs: list[Candidate]) -> list[float]:
    simulator = installed().create("sim", "pybullet")
    return [
        evaluation.reward for evaluation in evaluate_batch(on_panda(task), simulator, designs, 0, RolloutSettings())
    ]


@pytest.mark.parametrize("gripper", rare([False, True], False))
def test_a_fresh_population_makes_real_progress(gripper):
    pytest.importorskip("pybullet")
    assert max(rewards(CubeTask(), candidates(brief(CubeTask(), gripper=gripper, n_tool=5, n_action=2)))) > 0.6


HIGH = [(ShelfTask, False), pytest.param(DeepTask, True, marks=pytest.mark.thorough), (PanTask, False)]


@pytest.mark.parametrize(("task", "gripper"), HIGH)
def test_high_deep_and_contained_bodies_are_moved(task, gripper):
    pytest.importorskip("pybullet")
    assert max(rewards(task(), candidates(brief(task(), gripper=gripper, n_tool=4, n_action=1)))) > 0.9


@pytest.mark.parametrize("task", [HighObject(), ScoreGoal()], ids=lambda task: task.name)
def test_tools_of_a_soft_material_are_stout_enough(task):
    """In PLA, most of what it designs for the stiff default material would bend too far or break."""
    soft = installed().create("tool", "urdf")
    soft.material = Material("pla", 1240, 0.2, 1.2, 0.5, 2.5e9, 26e6)
    read = {}
    for representation in (soft, URDF):
        document = json.loads(reply(brief(task, n_tool=4, n_action=1, representation=representation)).text)
        read[representation] = read_designs(document, soft, SpawnRules(task, 0))
    assert [candidate.problem for candidate in read[soft]] == [None] * 4
    assert any("of pla, 1 N" in str(candidate.problem) for candidate in read[URDF])


class DrawerTask(CubeTask):
    """A drawer is to be opened, and a cube to be lifted."""

    goals = (Goal(joint="drawer", to=0.2), Goal(("cube",), held=True, after=0))
    every = True

    def scene(self, seed):
        case = Body.of("case", Box((0.1, 0.2, 0.1)), (1.0, 0.2, 0.05), mass=0.0, color=RED)
        box = Body.of("box", Box((0.1, 0.2, 0.1)), (0.9, 0.2, 0.05), mass=0.5, color=RED)
        slide = Joint("drawer", "slider", "box", "case", axis=(-1, 0, 0), lower=0, upper=0.3)
        return Scene((*super().scene(seed).bodies, case, box), (slide,))

    def reward(self, start, end, trace):
        return goals_reward(self, start, end, trace)


class SortTask(CubeTask):
    goals = (
        Goal(("cube", "box"), places=((0.6, 0.1, None), (0.6, -0.3, None))),
        Goal(("cube",), place=(0.5, None, None)),
        Goal(untouched=("box",)),
    )

    def scene(self, seed):
        box = Body.of("box", Box((0.1, 0.2, 0.1)), (0.9, 0.2, 0.05), mass=0.5, color=RED)
        return Scene((*super().scene(seed).bodies, box))


def test_what_no_plan_is_made_for_is_named():
    bodies = tuple(Body.of(name, Cylinder(0.03, 0.1), (0.7, 0, 0.05), mass=1.0, color=RED) for name in ("can", "tin"))
    door = Joint("door", "hinge", "tin", axis=(0, 0, 1))
    turned = Goal(("can",), axis=(1, 0, 0), points=(0, 1, 0), by_s=2.0)

    class Two(CubeTask):
        goals, every = (Goal(joint="door", to=1.0), turned), True

        def scene(self, seed):
            return Scene(bodies, (door,))

    assert left_out(Two(), 0) == [
        "a turn about the vertical",
        "a time limit",
        "a second goal, where one is a joint's or a turn (each tool is made for one)",
    ]
    assert left_out(CubeTask(), 0) == []


def test_goals_become_errands():
    drawer, cube = analysis(DrawerTask()).subgoals(np.random.default_rng(0))
    assert drawer.shift == pytest.approx([-0.2, 0, 0])
    assert cube.shift == pytest.approx([0, 0, 0.15])
    assert {len(analysis(SortTask()).subgoals(np.random.default_rng(seed))) for seed in range(8)} == {1, 2}
    for task in (DrawerTask(), SortTask()):
        assert candidates(brief(task))
