"""MuJoCo Warp on the processor: a few of the checks that every engine has to pass (``vlmgineer conformance
sim=mujoco_warp sim.device=cpu`` runs them all, in some minutes), and what is its own. Kernels are compiled in the first
minute; later runs find them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.designs.reading import load_designs, read_designs
from core.errors import UserError
from core.geometry import Box
from core.interfaces import JointTrajectory, Rollout
from core.plugins import installed
from core.scene import Body, Joint, Scene, table
from plugins.conformance import free_bodies, joints, output, robot
from plugins.conformance.output import bits
from plugins.conformance.sample_tools import stick
from plugins.conformance.worlds import BARE, GREY, Bodies, cube, motion, still
from tests.support.playing import evaluate_batch
from tests.support.worlds import end, film, start

pytest.importorskip("mujoco_warp")

import warp

from plugins.simulators.mujoco.batched import simulator
from tests.support.commands import python_m
from tests.support.panda import FINGER_OPEN

ROOT = Path(__file__).parents[3]
CHECKS = (
    output.check_batch_gives_what_each_job_alone_gives,
    robot.check_tool_stops_at_what_it_is_pushed_at,
    robot.check_arm_follows_its_trajectory,
    robot.check_gripper_lifts_what_it_can,
    free_bodies.check_free_fall,
    joints.check_joints_of_tools_move_as_formulas_say,
    free_bodies.check_hollow_tool_is_hollow,
    output.check_start_is_after_settling,
    output.check_states_name_the_free_bodies_in_order,
)


@pytest.fixture(scope="module")
def warped():
    return installed().create("sim", "mujoco_warp", {"device": "cpu"})


@pytest.mark.parametrize(
    "check", CHECKS, ids=lambda check: check.__name__.removeprefix("check_")
)
def test_simulator(warped, check):
    check(warped)


# --- as in sim=mujoco -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["BringCube", "OneBook", "ScoreGoal"])
def test_reference_solutions_are_as_good(warped, name):
    task = installed().create("task", name)
    designs = load_designs(ROOT / f"tests/tasks/solutions/{name}.json")
    candidates = read_designs(designs, installed().create("tool", "urdf"), task)
    ours, theirs = (
        evaluate_batch(task, engine, candidates)
        for engine in (warped, installed().create("sim", "mujoco"))
    )
    for one, other in zip(ours, theirs, strict=True):
        assert one.status == "ok", one.reason
        assert one.reward >= task.success_reward
        assert one.reward == pytest.approx(other.reward, abs=0.05)


def test_targets_that_are_not_numbers_are_refused_before_a_step(warped):
    broken = Rollout(BARE, replace(still(), arm=np.full_like(still().arm, np.nan)))
    played, refused = warped.rollout(Bodies(table()), [Rollout(BARE, still()), broken])
    assert played.error is None
    assert refused.error == "the trajectory's targets are not finite"


def test_the_same_film(warped):
    """Start and end, the arm's lag, and all between, to within what single precision makes of it."""
    job = Rollout(
        stick(0.25),
        motion([[0.45, 0, 0.3, 0, 0, 0], [0.58, 0, 0.3, 0, 0, 0]]),
        hold_s=0.2,
        record_hz=50.0,
    )
    task = Bodies(table(), cube(at=(0.6, 0, 0.05)))
    (ours,), (theirs,) = (
        engine.rollout(task, [job])
        for engine in (warped, installed().create("sim", "mujoco"))
    )
    assert ours.tracking_error_rad == pytest.approx(theirs.tracking_error_rad, abs=1e-3)
    np.testing.assert_array_equal(film(ours).times, film(theirs).times)
    np.testing.assert_allclose(film(ours).arm, film(theirs).arm, atol=1e-3)
    np.testing.assert_allclose(
        film(ours).states.positions, film(theirs).states.positions, atol=2e-3
    )
    np.testing.assert_allclose(
        start(ours).positions, start(theirs).positions, atol=1e-4
    )
    np.testing.assert_array_equal(film(ours).states.positions[-1], end(ours).positions)


# --- many worlds ------------------------------------------------------------------------------------------------


class Layouts(Bodies):
    """A cube, and a post that does not move, both where the seed says."""

    def scene(self, seed):
        post = Body.of(
            "post",
            Box((0.1, 0.1, 0.1)),
            (0.6, 0.3 - 0.05 * seed, 0.05),
            mass=0.0,
            color=GREY,
        )
        on_it = cube(at=(0.6, 0.3 - 0.05 * seed, 0.16), side=0.1)
        return Scene((table(), post, on_it))


def test_each_world_has_its_own_layout_and_tool_in_one_batch(warped):
    jobs = [
        Rollout(stick(0.1 + 0.02 * i), still(), seed=i, settle_s=0.3, hold_s=0.1 * i)
        for i in range(4)
    ]
    fresh = installed().create("sim", "mujoco_warp", {"device": "cpu"})
    outcomes = fresh.rollout(Layouts(), jobs)
    for seed, outcome in enumerate(outcomes):
        np.testing.assert_allclose(
            end(outcome).position("cube"), [0.6, 0.3 - 0.05 * seed, 0.15], atol=1e-3
        )
    again = fresh.rollout(Layouts(), jobs[::-1])[::-1]
    assert [bits(outcome) for outcome in again] == [
        bits(outcome) for outcome in outcomes
    ]


def test_contacts_that_find_no_room_are_given_more(warped):
    """Never a wrong result: with too little room at first, the numbers are those with enough."""
    fresh = installed().create("sim", "mujoco_warp", {"device": "cpu"})
    pile = [cube(f"c{i}", (0.6, 0.0, 0.05 + 0.1 * i)) for i in range(3)]
    task = Bodies(table(), *pile)
    jobs = [
        Rollout(BARE, still(), hold_s=0.2),
        Rollout(stick(0.1), still(), hold_s=0.2),
    ]
    enough = [bits(outcome) for outcome in fresh.rollout(task, jobs)]
    (shared,) = {figures.shared for _, figures in fresh._figures.values()}
    fresh._contacts[shared] = 4
    assert [bits(outcome) for outcome in fresh.rollout(task, jobs)] == enough
    assert fresh._contacts[shared] > 8


def test_with_more_contacts_than_there_can_be_room_for_it_is_an_error(monkeypatch):
    fresh = installed().create("sim", "mujoco_warp", {"device": "cpu"})
    monkeypatch.setattr(
        simulator, "_round_up", lambda count: 2 if count > 30 else count
    )
    monkeypatch.setattr(simulator, "_MOST_CONTACTS", 3)
    (outcome,) = fresh.rollout(
        Bodies(table(), cube(at=(0.6, 0, 0.05))), [Rollout(BARE, still(), hold_s=0.1)]
    )
    assert "contacts at once" in outcome.error
    assert outcome.end is None


def test_a_world_that_explodes_is_an_error_and_hurts_no_other(capfd):
    fresh = installed().create("sim", "mujoco_warp", {"device": "cpu"})
    task = Bodies(table(), cube(at=(0.6, 0, 0.05)))
    sound = Rollout(stick(0.25), still(), hold_s=0.2, record_hz=10)
    far = np.stack([still().arm[0], still().arm[0] + 1e12])
    targets = JointTrajectory(np.array([0.0, 0.1]), far, np.full(2, FINGER_OPEN))
    before, failed, after = fresh.rollout(
        task, [sound, Rollout(stick(0.2), targets), sound]
    )
    assert "blew up" in failed.error
    assert failed.end is None
    assert bits(before) == bits(after) == bits(fresh.rollout(task, [sound])[0])
    assert capfd.readouterr() == ("", "")


# --- settings and devices ---------------------------------------------------------------------------------------


def test_without_a_card_it_says_so():
    with pytest.raises(UserError, match=r"sim\.device 'gpu'"):
        installed().create("sim", "mujoco_warp", {"device": "gpu"})
    if not warp.get_cuda_devices():
        with pytest.raises(
            UserError,
            match=r"sim\.device=cuda: no graphics card with CUDA is found here",
        ):
            installed().create("sim", "mujoco_warp")


def test_a_run_on_the_processor(tmp_path):
    words = [
        "sim=mujoco_warp",
        "sim.device=cpu",
        "task=BringCube",
        "hydra.run.dir=out",
        "film=false",
    ]
    budget = [
        "budget=tiny",
        "budget.n_tool=2",
        "budget.n_action=2",
    ]
    done = python_m(tmp_path, "core.run", *words, *budget)
    assert done.returncode == 0, done.stderr
    assert "4 rollouts;" in done.stderr
    # It reports kernels and a missing driver by default.
    assert "Warp" not in done.stderr


def test_what_it_lacks_names_the_engine_that_has_it(warped):
    thrown = replace(
        Body.of("ball", Box((0.1, 0.1, 0.1)), (0, 0, 3), mass=1.0, color=GREY),
        velocity=(1.0, 0.0, 0.0),
    )
    hung = Bodies(
        replace(thrown, velocity=(0.0, 0.0, 0.0)),
        joints=(Joint("pin", "ball", "ball"),),
    )
    job = Rollout(BARE, still())
    for task, wanted in (
        (Bodies(thrown), job),
        (hung, job),
        (Bodies(), replace(job, forces=True)),
    ):
        with pytest.raises(UserError, match=r"use sim=mujoco( or |$)"):
            warped.rollout(task, [wanted])
