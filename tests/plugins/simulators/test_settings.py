"""Test what each engine does for itself, and all alike: settings, tracking, fingers, the renderer, missing packages."""

import json
import math

import numpy as np
import pytest

from core.errors import UserError
from core.geometry import Box
from core.interfaces import JointTrajectory, Rollout
from core.plugins import installed
from core.scene import Body, floor, table
from plugins.conformance.sample_tools import stick
from plugins.conformance.worlds import BARE, GREY, HAND, Bodies, cube, still
from tests.support.engines import every_simulator, simulator
from tests.support.packages import without
from tests.support.panda import FINGER_OPEN
from tests.support.worlds import end, film, move, wait

SMALL = [
    "budget=tiny",
    "budget.n_action=2",
    "executor.workers=2",
]
SETTINGS = {
    "pybullet": "solver_iterations",
    "sapien": "solver_iterations",
    "mujoco": "slip_rate",
}
NEEDS = {
    "pybullet": "needs PyBullet: pip install pybullet",
    "sapien": "needs SAPIEN: pip install 'sapien",
    "mujoco": "needs MuJoCo 4 or newer: pip install 'mujoco",
}


def made(engine, **settings):
    simulator(engine)  # skips the test where its module is missing
    return installed().create("sim", engine, settings)


@every_simulator
@pytest.mark.parametrize("value", [0, -0.001, 0.1, math.nan])
def test_time_steps_that_make_no_sense(engine, value):
    with pytest.raises(UserError, match="time_step"):
        made(engine, time_step=value)


@every_simulator
def test_numbers_that_make_no_sense(engine):
    for setting, value in (
        ("tracking_rate", 0),
        (SETTINGS[engine], 0),
        (SETTINGS[engine], -1),
    ):
        with pytest.raises(UserError, match=setting):
            made(engine, **{setting: value})


@every_simulator
def test_cards_that_fall_on_cards_lie_on_them(engine):
    """From 5 cm, a little tilted and aside: with the usual step 6 of these 12 fall through in MuJoCo, 1 in SAPIEN."""
    rng = np.random.default_rng(9)
    card = Box((0.04, 0.03, 0.003))
    cards = []
    for number in range(12):
        x = 0.4 + 0.12 * (number % 4)
        y = -0.3 + 0.2 * (number // 4)
        aside = rng.uniform(-0.012, 0.012, 2)
        tilt = rng.uniform(-0.3, 0.3, 2)
        place = (x + aside[0], y + aside[1], 0.05)
        low = Body.of(f"low_{number}", card, (x, y, 0.0016), mass=0.005, color=GREY)
        high = Body.of(
            f"high_{number}", card, place, mass=0.005, color=GREY, rpy=(*tilt, 0)
        )
        cards += [low, high]

    after = end(wait(simulator(engine), table(), *cards, seconds=0.6))
    for number in range(12):
        above = after.position(f"high_{number}") - after.position(f"low_{number}")
        assert above[2] > 0


@pytest.mark.parametrize(
    ("engine", "time_step", "off"),
    [
        *[
            ("pybullet", 0.001, 0.03),
            ("pybullet", 0.004, 0.03),
            ("sapien", 0.002, 0.02),
            ("sapien", 0.01, 0.02),
        ],
        *[("mujoco", 0.001, 0.01), ("mujoco", 0.004, 0.03)],
    ],
)
def test_what_happens_hardly_depends_on_the_time_step(engine, time_step, off):
    plan = [[0.6, 0.2, 0.3, 0, 0.3, 0], [0.6, -0.2, 0.3, 0, 0, 0.5]]
    bodies = table(), cube(at=(0.6, 0, 0.05))
    sims = simulator(engine), made(engine, time_step=time_step)
    ours, theirs = (
        move(sim, plan, *bodies, tool=stick(0.25), record_hz=10) for sim in sims
    )
    length = min(len(film(ours).times), len(film(theirs).times))
    assert np.abs(film(ours).arm[:length] - film(theirs).arm[:length]).max() < 0.03
    np.testing.assert_allclose(
        end(ours).position("cube"), end(theirs).position("cube"), atol=off
    )


@pytest.mark.parametrize(
    ("engine", "time_step", "most"),
    [
        *[("pybullet", 0.001, 1.1), ("pybullet", 0.002, 1.1), ("pybullet", 0.004, 1.1)],
        *[
            ("sapien", 0.002, 1.4),
            ("sapien", 0.004, 2.2),
        ],  # stiff joints come in faster at long steps, never slower
    ],
)
@pytest.mark.parametrize("rate", [20.0, 50.0])
def test_joints_close_in_on_their_targets_at_the_tracking_rate(
    engine, time_step, most, rate
):
    # The first joint's target jumps.
    arms = still().arm + np.array([[0.0], [0.002]]) * np.eye(7)[0]
    jump = JointTrajectory(np.array([0.0, 1e-4]), arms, np.full(2, FINGER_OPEN))
    job = Rollout(BARE, jump, settle_s=0.1, hold_s=0.1, record_hz=250)
    (outcome,) = made(engine, time_step=time_step, tracking_rate=rate).rollout(
        Bodies(), [job]
    )
    times = film(outcome).times
    left = arms[1, 0] - film(outcome).arm[:, 0]
    first, last = np.searchsorted(times, [0.0119, 0.0319])
    found = np.log(left[first] / left[last]) / (times[last] - times[first])
    assert 0.9 * rate < found < most * rate


@pytest.mark.parametrize("engine", ["sapien", "mujoco"])
def test_fingers_stay_as_far_from_the_middle(engine):
    """One motor moves both: a body off the middle is not pushed there by one finger alone."""
    over = 0.1034 + 0.02
    plan = [[0.5, 0, over, 0, 0, 0, 0], [0.5, 0, over, 0, 0, 0, 1]]
    post = Body.of(
        "post", Box((0.02, 0.02, 0.04)), (0.5, 0.015, 0.02), mass=0, color=GREY
    )
    fingers = film(
        move(simulator(engine), plan, table(), post, tool=HAND, record_hz=50)
    ).fingers
    assert fingers[-1].min() > 0.003
    assert np.abs(fingers[:, 0] - fingers[:, 1]).max() < 3e-3


# --- pictures, and missing packages -----------------------------------------------------------------------------


def test_mujocos_renderer_sees_what_pybullets_sees():
    """The same camera and scene: edges of the cube, the table and the arm are at the same pixels."""
    task = Bodies(floor(), table(), cube(at=(0.7, 0, 0.1), side=0.2))
    own = made("mujoco")
    ours, theirs = (
        sim.render(task, tool=stick(0.3), width=160, height=120)
        .astype(float)
        .mean(axis=-1)
        for sim in (own, simulator("pybullet"))
    )
    if "pybullet" in own.drawn_by:
        pytest.skip(f"{own.drawn_by}; for example Debian's libegl1 has what it needs")
    assert own.drawn_by.startswith("MuJoCo's renderer on ")
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("engine", "missing", "refusal"),
    [
        pytest.param(
            "sapien",
            ["pybullet"],
            "the engine draws nothing itself, and pybullet's can't stand in",
            marks=pytest.mark.thorough,
        ),
        pytest.param(
            "mujoco",
            ["pybullet", "OpenGL"],
            "MuJoCo's own renderer needs OpenGL",
            marks=pytest.mark.thorough,
        ),
    ],
)
def test_without_pybullet_and_a_display_it_runs_without_pictures(
    engine, missing, refusal, tmp_path
):
    done = without(
        missing, ["core.run", f"sim={engine}", *SMALL, "hydra.run.dir=out"], tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert f"no pictures: {refusal}" in done.stderr
    assert "pip install pybullet" in done.stderr
    assert json.loads((tmp_path / "out/result.json").read_text())["best"]["reward"] > 0
    assert not (tmp_path / "out/scene.png").exists()


@pytest.mark.thorough
@pytest.mark.slow
@every_simulator
def test_without_its_library_others_run(engine, tmp_path):
    other = "mujoco" if engine == "pybullet" else "pybullet"
    simulator(other)  # skips the test where it is missing
    done = without(
        [engine],
        ["core.run", f"sim={other}", *SMALL, "hydra.run.dir=out", "film=false"],
        tmp_path,
    )
    assert done.returncode == 0, done.stderr
    refused = without([engine], ["core.run", f"sim={engine}", *SMALL], tmp_path)
    assert refused.returncode == 1
    assert refused.stderr.count("\n") == 1
    assert f"sim={engine} {NEEDS[engine]}" in refused.stderr
