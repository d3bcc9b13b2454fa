"""Requirements for every task of both benchmarks, beside those of any task, which `vlmgineer conformance` checks
(`tests/plugins/conformance/test_suites.py`).
"""

import hashlib
import itertools
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf

from core.config.compose import load, node
from core.design import Candidate, Tool
from core.designs.reading import load_designs, read_designs
from core.errors import UserError
from core.geometry import Mesh
from core.goals import Away, reaches
from core.interfaces import JointTrajectory, Rollout, RolloutSettings, Waypoints
from core.plugins import installed
from core.robot.solids import Obstacles, body_solids, signed_distance
from core.values.layouts import Draw
from plugins.fitness.layouts import UNSEEN
from tests.support.engines import every_simulator, mujoco_first, simulator
from tests.support.panda import ARM, FINGER_OPEN
from tests.support.playing import evaluate_batch
from tests.support.solutions import anchored

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
OFFERED = {
    name: offer.entry_point
    for (kind, name), offer in installed().offers.items()
    if kind == "task"
}
TASKS = [name for name, benchmark in OFFERED.items() if benchmark == "robotoolbench"]
HARD = [name for name, benchmark in OFFERED.items() if benchmark == "hardtoolbench"]
MOVING = {"StopCart"}  # in which things move by themselves
PROTOCOL = node(load("evaluate", ["protocol=varied"]).rollout, RolloutSettings)

# n_agent, n_tool, n_action, k_top, reward_save, n_iteration
PAPER = {
    **dict.fromkeys(
        (
            "BringCube",
            "CleanTable",
            "DislodgeCube",
            "ElevatePlate",
            "GatherSpheres",
            "MoveBall",
        ),
        (20, 10, 10, 5, 0.6, 3),
    ),
    "HighObject": (20, 10, 10, 5, 0.5, 3),
    "LiftBox": (30, 15, 15, 5, 0.1, 3),
    "OneBook": (20, 10, 10, 5, 0.4, 3),
    "ScoreGoal": (20, 10, 10, 5, 0.4, 3),
    "SnatchCookie": (5, 5, 5, 5, 0.3, 3),
    "TurkeyLegs": (30, 10, 15, 5, 0.2, 4),
}

every_task = pytest.mark.parametrize("name", TASKS)
every_task_of_both = pytest.mark.parametrize("name", [*TASKS, *HARD])

VARIATIONS = ("near", "wide")
OTHERS = ("pybullet", "sapien")
QUICK = {"BringCube", "OneBook", "HangRing", "OpenLatch"}  # in every engine
SLOW = {"GatherSpheres", "TurkeyLegs"}
ANCHORED = {"BringCube", "LiftBox", "SweepCards"}


@cache
def task_of(name, variation="none"):
    return installed().create("task", name, variation=variation)


@cache
def idle(name, engine):
    """The outcome of seconds in which the bare arm stays home: of HardToolBench in a drawn layout."""
    task = task_of(name, "wide" if name in HARD else "none")
    still = JointTrajectory(
        np.zeros(1), ARM.home_for(task.home)[None], np.array([FINGER_OPEN])
    )
    hold_s = 0.0 if name in MOVING else 3.0 if name in HARD else 5.0
    (outcome,) = simulator(engine).rollout(
        task, [Rollout(Tool(), still, settle_s=0.5, hold_s=hold_s)]
    )
    assert outcome.error is None
    scene = task.scene(0)
    return scene, replace(
        outcome, start=scene.complete(outcome.start), end=scene.complete(outcome.end)
    )


# --- what a task says of itself ---------------------------------------------------------------------------------


@every_task_of_both
def test_names_and_words(name):
    task = task_of(name)
    assert task.description.endswith(".")
    assert len(task.description) > 80
    assert task.success_reward > 0.5
    assert f"class {name}(Task):" in task.source()  # the file that a model is shown
    assert "def reward" in task.source()
    assert load("config", [f"task={name}"]).task.name == name
    if name in HARD:
        assert set(task.variations) == set(VARIATIONS)
        assert all(
            heading in type(task).__doc__
            for heading in ("Task: ", "Layouts: ", "Success: ")
        )


@every_task
def test_the_config_has_the_papers_parameters(name):
    config = OmegaConf.to_container(load("config", [f"task={name}"]).task)
    keys = ("n_agent", "n_tool", "n_action", "k_top", "reward_save", "n_iteration")
    assert config["tool_kinds"]
    assert set(config["tool_kinds"]) <= {"rigid", "gripper"}
    if name in PAPER:
        assert config["paper"] == dict(zip(keys, PAPER[name], strict=True))
    assert set(config["paper"]) == set(keys)


@every_task
def test_all_that_matters_is_in_the_picture(name):
    task = task_of(name)
    position = np.array(task.camera.position)
    target = np.array(task.camera.target)
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    places = [
        body.pose.position
        for body in task.scene(0).bodies
        if not body.fixed or not body.collisions
    ]
    for point in [*places, task.home.position]:
        way = point - position
        depth = way @ forward
        assert depth > 0
        half = math.tan(math.radians(task.camera.fov_deg / 2))
        assert abs(way @ up) < half * depth
        assert abs(way @ right) < half * depth * 4 / 3


# --- the scene --------------------------------------------------------------------------------------------------


def layout(name, seed, variation="none"):
    """A digest of all bodies and their poses."""
    digest = hashlib.sha256()
    for body in task_of(name, variation).scene(seed).bodies:
        digest.update(
            f"{body.name} {body.mass} {body.friction} {body.rolling_friction} {body.restitution}".encode()
        )
        digest.update(body.pose.matrix.tobytes())
        for part in (*body.visuals, *body.collisions):
            digest.update(part.pose.matrix.tobytes())
            shape = part.shape
            digest.update(
                shape.vertices.tobytes()
                if isinstance(shape, Mesh)
                else repr(shape).encode()
            )
    return digest.hexdigest()


@every_task_of_both
@pytest.mark.parametrize("variation", VARIATIONS)
def test_a_variation_draws_all_that_it_names(name, variation, monkeypatch):
    assert len({layout(name, seed, variation) for seed in range(4)}) == 4
    asked = set()
    draw = Draw.__call__
    monkeypatch.setattr(
        Draw,
        "__call__",
        lambda self, key, nominal: asked.add(key) or draw(self, key, nominal),
    )
    task = installed().create("task", name, variation=variation)
    task.scene(0)
    assert set(task.ranges) <= asked


def test_a_variation_that_a_task_does_not_have():
    with pytest.raises(
        UserError, match=r"no variation 'far' in the task BringCube.*near, none, wide"
    ):
        installed().create("task", "BringCube", variation="far")


@every_task_of_both
@pytest.mark.parametrize(
    ("variation", "seeds"),
    [
        ("none", [0]),
        ("near", [0]),
        ("wide", [3, 4]),
        pytest.param("wide", range(5, 12), marks=pytest.mark.thorough),
    ],
)
def test_no_body_penetrates_another(name, variation, seeds):
    """By a twentieth of a millimetre; any task may by a whole one."""
    pairs = 0
    for scene in (task_of(name, variation).scene(seed) for seed in seeds):
        for one, other in itertools.combinations(
            [body for body in scene.bodies if body.collisions], 2
        ):
            if (one.fixed and other.fixed) or frozenset(
                (one.name, other.name)
            ) in scene.joined:
                continue
            others = Obstacles(body_solids(other))
            for solid in body_solids(one):
                for near in others.near(solid, 0.01):
                    gap = signed_distance(solid, near)
                    pairs += 1
                    assert gap > -5e-5, (
                        f"{one.name} is {-1000 * gap:.2f} mm inside {other.name}"
                    )
    assert pairs > 0


@mujoco_first
@every_task_of_both
def test_the_scene_rests_and_the_bare_arm_is_clear_of_it(name, engine):
    """Otherwise it would push bodies aside in the first instant, or be pushed."""
    scene, outcome = idle(name, engine)
    placed = scene.state()
    start = outcome.start
    end = outcome.end
    assert np.linalg.norm(start.positions - placed.positions, axis=-1).max() < 5e-3
    assert outcome.tracking_error_rad < 2e-3
    assert np.linalg.norm(end.positions - start.positions, axis=-1).max() < 2e-3
    if name not in HARD:
        turned = [
            (start.pose(body).rotation.inv() * end.pose(body).rotation).magnitude()
            for body in start.names
        ]
        assert math.degrees(max(turned)) < 2
        assert np.abs(end.linear_velocities).max() < 0.02


# --- the reward -------------------------------------------------------------------------------------------------


def moved(state, shifts):
    """A state with bodies shifted (3,) by name."""
    positions = state.positions.copy()
    for name, shift in shifts.items():
        positions[state.names.index(name)] += shift
    return replace(state, positions=positions)


def ways(task, start):
    """For each goal, the shifts that bring its bodies straight there."""
    for goal in reaches(task.goals):
        if isinstance(goal, Away):
            yield dict.fromkeys(goal.bodies, np.array([-1.05 * goal.away, 0.0, 0.0]))
            continue
        shifts = {}
        for body in goal.subjects(start):
            way = goal.place_of(body, start) - start.position(body)
            shifts[body] = np.nan_to_num(way)  # of a coordinate that is free
        yield shifts


@every_simulator
@every_task
def test_doing_nothing_earns_nothing(name, engine):
    _, outcome = idle(name, engine)
    reward = task_of(name).reward(outcome.start, outcome.end)
    assert np.shape(reward) == ()
    assert 0 <= reward < 0.02


@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(e, marks=pytest.mark.thorough) for e in OTHERS)]
)
def test_doing_nothing_earns_nothing_where_rewards_read_traces(name, engine):
    task = task_of(name, "wide")
    home = Waypoints(np.array([[*task.home.position, *task.home.rpy]]))
    (evaluation,) = evaluate_batch(
        task, simulator(engine), [Candidate(Tool(), home)], settings=PROTOCOL
    )
    assert (evaluation.status, evaluation.reason) == ("ok", "")
    assert 0 <= evaluation.reward < 0.02


@every_task
@settings(max_examples=30)
@given(data=st.data())
def test_the_reward_rises_from_0_to_1_on_the_way_to_the_goal(name, data):
    task = task_of(name, data.draw(st.sampled_from(["none", *VARIATIONS])))
    seed = data.draw(st.integers(0, 50))
    start = task.scene(seed).state()
    for shifts in ways(task, start):

        def reward(share, shifts=shifts):
            return float(
                task.reward(
                    start,
                    moved(
                        start, {body: share * shift for body, shift in shifts.items()}
                    ),
                )
            )

        less, more = sorted(data.draw(st.tuples(st.floats(0, 1), st.floats(0, 1))))
        assert reward(0) == pytest.approx(0, abs=1e-9)
        assert reward(1) >= 0.95
        assert 0 <= reward(less) <= reward(more) + 1e-9 <= 1 + 1e-9
        # Progress counts.
        assert any(0.02 < reward(share) < 0.98 for share in np.linspace(0, 1, 50))


@every_task
def test_everything_thrown_far_away_earns_little(name):
    task = task_of(name)
    start = task.scene(0).state()
    far = moved(start, dict.fromkeys(start.names, np.array([50.0, -50.0, -0.6])))
    assert float(task.reward(start, far)) <= 0.2


# --- solutions --------------------------------------------------------------------------------------------------


def solutions(name):
    document = load_designs(Path(__file__).parent / "solutions" / f"{name}.json")
    return read_designs(document, installed().create("tool", "urdf"), task_of(name))


def cases(quick, slow=()):
    """Tasks in engines: in MuJoCo all but ``slow`` ones, and those in ``quick`` in the others; the rest is thorough."""
    for name, engine in itertools.product([*TASKS, *HARD], ("mujoco", *OTHERS)):
        rare = name in slow or (engine != "mujoco" and name not in quick)
        yield pytest.param(
            name,
            engine,
            marks=[pytest.mark.slow, *([pytest.mark.thorough] if rare else [])],
        )


@pytest.mark.parametrize(
    ("name", "engine"), [case for case in cases(QUICK, SLOW) if case.values[0] in TASKS]
)
def test_the_reference_solution_solves_it(name, engine):
    task = task_of(name)
    candidates = solutions(name)
    assert [candidate.problem for candidate in candidates] == [None] * len(candidates)
    evaluations = evaluate_batch(task, simulator(engine), candidates)
    best = max(evaluations, key=lambda e: e.reward)
    assert best.status == "ok"
    assert best.reward >= 0.95
    assert best.solved
    assert best.distance_m > 0.05


def layouts():
    """One layout in each engine; four are tried weekly."""
    for case in cases((), {*TASKS, *HARD} - ANCHORED):
        yield pytest.param(*case.values, 1, marks=case.marks)
        weekly = [*case.marks, pytest.mark.weekly]
        yield pytest.param(*case.values, 4, marks=weekly)


@pytest.mark.parametrize(("name", "engine", "count"), [*layouts()])
def test_the_anchored_solution_fits_layouts_that_it_was_not_made_for(
    name, engine, count
):
    """A few of those that the docs have figures of."""
    protocol, material = (
        (PROTOCOL, "pla") if name in HARD else (RolloutSettings(), "paper")
    )
    solution = anchored(name, material)
    task = task_of(name, "wide")
    seeds = range(UNSEEN, UNSEEN + count)
    trials = [
        evaluate_batch(task, simulator(engine), [solution], seed, protocol)[0]
        for seed in seeds
    ]
    assert not [trial.reason for trial in trials if trial.status != "ok"]
    assert np.mean([trial.reward for trial in trials]) >= 0.7
