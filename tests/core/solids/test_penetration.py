"""Penetration made on purpose, as recordings and in a real engine."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.design import Candidate, Tool, ToolJoint
from core.errors import UsageError
from core.geometry import Box, Cylinder, Pose, Sphere
from core.goals import Placed
from core.interfaces import (
    Outcome,
    Rollout,
    RolloutSettings,
    Simulator,
    Task,
)
from core.plugins import installed
from core.robot.trajectory import at_home
from core.scene import Joint, Scene, table
from core.solids.penetration import Explosion, findings
from plugins.conformance.joints import hinge, hinged
from tests.support.panda import ARM, PANDA
from tests.support.playing import evaluate_batch
from tests.support.recordings import (
    HZ,
    ROD,
    WALL,
    body,
    penetrations,
    recording,
    straight,
)

# --- passing through --------------------------------------------------------------------------------------------


def test_a_cube_that_creeps_into_a_wall_is_found():
    """It moves by 0.02 mm from sample to sample, less than what counts as motion."""
    cube = body("cube", Box((0.04, 0.04, 0.04)), (0.46, 0.0, 0.25))
    path = straight((0.46, 0, 0.25), (0.5, 0, 0.25), 2000)
    assert penetrations(
        Scene((WALL, cube)), recording(Scene((WALL, cube)), {"cube": path})
    )


@pytest.mark.parametrize("speed", [0.2, 1.0, 5.0, 20.0])
@pytest.mark.parametrize(
    "shape", [Sphere(0.02), Box((0.03, 0.05, 0.02)), Cylinder(0.01, 0.2)]
)
def test_a_body_that_goes_through_a_wall_is_found_however_fast(shape, speed):
    scene = Scene((WALL, body("thing", shape, (0.2, 0, 0.25))))
    path = straight((0.2, 0.0, 0.25), (0.8, 0.0, 0.25), max(4, round(0.6 / speed * HZ)))
    (found,) = penetrations(scene, recording(scene, {"thing": path}))
    assert "'thing'" in found
    assert "'wall'" in found


@pytest.mark.parametrize(
    ("deep_mm", "guided", "mass", "found"),
    [
        (2.5, True, 0.0, 0),
        (4.0, True, 0.0, 1),
        (4.0, False, 0.0, 0),
        (12.0, False, 0.0, 1),
        (2.5, True, 0.5, 0),
        (4.0, True, 0.5, 0),  # a post that stands loose may give way
        (4.0, False, 0.5, 0),
    ],
)
def test_a_button_is_not_pressed_through_its_post(deep_mm, guided, mass, found):
    """What hangs from a joint is no deeper in what is fixed than an engine's contacts are soft."""
    button = body("button", Cylinder(0.015, 0.03), (0.5, 0, 0.2))
    post = body("post", Box((0.05, 0.05, 0.1)), (0.5, 0, 0.13), mass=mass)
    press = Joint("press", "slider", "button", axis=(0, 0, -1), lower=0, upper=0.02)
    scene = Scene((post, button), (press,) if guided else ())
    down = straight((0.5, 0, 0.2), (0.5, 0, 0.195 - deep_mm / 1000), 20)
    held = np.repeat(down[-1:], 20, axis=0)
    paths = {"button": np.concatenate([down, held])}
    if mass:
        paths["post"] = np.tile(post.pose.position, (len(paths["button"]), 1))

    assert len(penetrations(scene, recording(scene, paths))) == found


CARD = Box((0.04, 0.03, 0.003))
LYING = body("lying", CARD, (0.5, 0.3, 0.0015))
FALLING = body("falling", CARD, (0.52, 0.3, 0.05), rpy=(0, np.pi / 2, 0))
CARDS = Scene((LYING, FALLING))


@pytest.mark.parametrize(("inside", "through"), [(2, False), (8, True)])
def test_a_card_whose_edge_slips_off_the_end_of_another_did_not_pass_through_it(
    inside, through
):
    """It meets the other 2.2 mm from its end, at 0.8 m/s; ``inside``: for so many steps of an engine."""
    heights = np.r_[np.linspace(0.0346, 0.0226, 7), np.full(inside, 0.0206)]
    x = np.full(len(heights), 0.5193)
    aside = np.linspace(0.5203, 0.5253, 6)
    path = np.full((len(heights) + len(aside), 3), 0.3)
    path[:, 0] = np.r_[x, aside]
    path[:, 2] = np.r_[heights, np.full(len(aside), 0.0206)]
    upright = {"falling": np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])}
    lying = {"lying": np.tile((0.5, 0.3, 0.0015), (len(path), 1))}

    taken = recording(CARDS, {"falling": path, **lying}, hz=400.0, quaternions=upright)
    found = penetrations(CARDS, taken)
    assert ["passed through" in text for text in found] == [True] * through


def test_a_card_that_falls_through_another_passed_through_it_however_fast():
    path = straight((0.52, 0.3, 0.03), (0.52, 0.3, -0.03), 25)
    upright = {"falling": np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])}
    lying = {"lying": np.tile((0.52, 0.3, 0.0015), (len(path), 1))}

    taken = recording(CARDS, {"falling": path, **lying}, hz=400.0, quaternions=upright)
    (found,) = penetrations(CARDS, taken)
    assert "'falling'" in found


LAID = Scene((table(), body("cube", Box((0.05, 0.05, 0.05)), (0.5, 0.3, 0.025))))
SUNK = (0.5, 0.3, 0.010)  # 15 mm deep
FALL = np.vstack(
    [np.tile((0.5, 0.3, 0.3), (195, 1)), straight((0.5, 0.3, 0.3), (0.5, 0.3, 0.03), 5)]
)


@pytest.mark.parametrize(
    ("way", "rest", "hz"),
    [(straight((0.5, 0.3, 0.025), SUNK, 10), 10, HZ), (FALL, 200, 400.0)],
)
def test_a_body_that_gets_in_and_stays(way, rest, hz):
    """It sinks, or is thrown: what rests is not looked at more often, and not less either."""
    path = np.vstack([way, np.tile(SUNK, (rest, 1))])
    (found,) = penetrations(LAID, recording(LAID, {"cube": path}, hz=hz))
    assert "deep inside 'table'" in found


def test_a_thrown_body_that_rests_too_deep_is_found_however_deep():
    """Where it was looked at last on its way down, it may be almost too deep, and then it does not move any more."""

    def found(height):
        way = np.vstack([FALL, np.tile((0.5, 0.3, height), (200, 1))])
        return penetrations(LAID, recording(LAID, {"cube": way}, hz=400.0))

    assert all(len(found(height)) == 1 for height in np.linspace(0.005, 0.0149, 41))
    assert found(0.0152) == []  # 9.8 mm deep


def test_a_body_that_turns_through_a_wall():
    """Its middle stays where it is; only its end passes."""
    bar = body("bar", Box((0.3, 0.01, 0.01)), (0.4, 0.0, 0.25))
    turns = Rotation.from_euler("z", np.linspace(0.7, 2.4, 6)[:, None])
    scene = Scene(
        (body("wall", Box((0.01, 0.01, 0.5)), (0.4, 0.1, 0.25), mass=0.0), bar)
    )
    taken = recording(
        scene,
        {"bar": np.tile((0.4, 0.0, 0.25), (6, 1))},
        quaternions={"bar": turns.as_quat(scalar_first=True)},
    )
    assert len(penetrations(scene, taken)) == 1


@given(
    solid=st.sampled_from(
        [
            Sphere(0.03),
            Box((0.08, 0.02, 0.05)),
            Cylinder(0.03, 0.02),
            Cylinder(0.012, 0.1),
        ]
    ),
    radius=st.floats(0.005, 0.05),
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(3, 40),
    carried=st.booleans(),
    beside=st.booleans(),
)
def test_a_ball_goes_through_a_solid_or_beside_it(
    solid, radius, seed, count, carried, beside
):
    """From anywhere, spinning; or the ball stands, spins, and the solid comes: the result is the same."""
    random = np.random.default_rng(seed)
    turn, way = Rotation.random(rng=random), Rotation.random(rng=random).as_matrix()
    middle = np.array([1.5, 1.5, 1.0])  # out of the arm's way
    reach = 0.08  # no point of a solid is farther from its middle
    off = (reach + radius + 0.001) * way[1] if beside else np.zeros(3)
    path = (
        middle
        + off
        + np.linspace(-0.3, 0.3 + 0.3 * random.random(), count)[:, None] * way[0]
    )
    scene = Scene(
        (
            body("ball", Sphere(radius), path[0]),
            body("solid", solid, middle, 0.1 * carried, turn.as_euler("xyz")),
        )
    )
    paths = {"ball": path}
    if carried:
        still = np.tile(path[0], (count, 1))
        paths = {"ball": still, "solid": middle + path[0] - path}
    quaternions = {
        "ball": Rotation.random(count, rng=random).as_quat(scalar_first=True),
        "solid": turn.as_quat(scalar_first=True),
    }
    taken = recording(scene, paths, quaternions=quaternions)
    assert len(penetrations(scene, taken)) == (not beside)


def sweep(turn, count):
    """The arm turns about its base."""
    arms = np.tile(ARM.home, (count, 1))
    arms[:, 0] += np.linspace(-turn, turn, count)
    return arms


@pytest.mark.parametrize("count", [4, 12, 60])
def test_a_tool_that_goes_through_a_wall(count):
    below = ARM.forward(ARM.home).apply((0.0, 0.0, -0.15))
    scene = Scene((body("fence", Box((0.3, 0.01, 0.05)), below, mass=0.0),))
    taken = recording(scene, {}, arms=sweep(0.4, count))
    (found,) = penetrations(scene, taken)
    assert found.startswith("'rod'")
    # The bare arm is above it.
    assert penetrations(scene, taken, Tool()) == []


# --- what is no penetration -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("swing", "through"), [(1.0, True), (0.0, False), (-1.0, False)]
)
def test_a_component_with_a_joint_is_followed(swing, through):
    """The arm stays at home; the rod swings to the side where a wall is, or away from it."""
    wall = body("wall", Box((0.5, 0.005, 0.2)), (0.5, 0.06, 0.3), mass=0.0)
    arms = np.tile(ARM.home_for(Pose.xyz_rpy((0.5, 0.0, 0.5))), (26, 1))
    taken = recording(Scene((wall,)), {}, arms=arms)
    taken = replace(
        taken, fingers=np.column_stack([taken.fingers, straight(0.0, swing, 26)])
    )
    assert bool(penetrations(Scene((wall,)), taken, hinged(0.0, hinge()))) is through


@pytest.mark.parametrize("speed", [0.5, 3.0, 10.0])
def test_over_the_wall_and_along_it_is_no_penetration(speed):
    scene = Scene((WALL, body("ball", Sphere(0.02), (0.2, 0, 0.25))))
    count = max(4, round(1.0 / speed * HZ))
    over = straight((0.2, 0.0, 0.525), (0.8, 0.0, 0.525), count)
    along = straight((0.4748, -0.3, 0.25), (0.4748, 0.3, 0.25), count)
    for path in (over, along):
        assert findings(scene, PANDA, ROD, recording(scene, {"ball": path})) == []


def test_a_bounce_and_a_hard_blow_are_no_penetration():
    scene = Scene((WALL, body("ball", Sphere(0.02), (0.2, 0, 0.25))))
    # 15 mm into the wall for a moment.
    out = straight((0.1, 0.0, 0.25), (0.49, 0.0, 0.25), 6)
    path = np.vstack([out, out[::-1]])
    assert findings(scene, PANDA, ROD, recording(scene, {"ball": path})) == []


def test_what_stands_in_each_other_from_the_start_is_no_penetration():
    scene = Scene((WALL, body("plug", Cylinder(0.02, 0.2), (0.5, 0.0, 0.25))))
    taken = recording(scene, {"plug": straight((0.5, 0.0, 0.25), (0.5, 0.0, 0.3), 30)})
    assert findings(scene, PANDA, ROD, taken) == []


# --- flung ------------------------------------------------------------------------------------------------------

FLYING = Scene((body("ball", Sphere(0.02), (0.5, 0, 1.0)),))


def test_a_body_faster_than_the_robot_can_make_it_was_flung():
    path = {"ball": straight((0.5, 0.0, 1.0), (3.0, 0.0, 1.0), 10)}

    def found(speed, arms=None):
        moving = {"ball": (speed, 0, 0)}
        taken = recording(FLYING, path, velocities=moving, arms=arms)
        return findings(FLYING, PANDA, ROD, taken)

    (flung,) = found(50.0)
    assert not flung.penetration
    assert "flung" in flung.text
    assert "50.0 m/s" in flung.text
    swing = sweep(1.0, 10)  # some 5 m/s
    assert found(8.0, swing) == []
    (faster,) = found(50.0, swing)
    robot_speed = float(faster.text.split()[-2])
    for times, count in ((2.1, 0), (2.4, 1)):  # an elastic blow gives twice the speed
        assert len(found(times * robot_speed, swing)) == count


def test_a_fall_is_no_fling():
    times = np.arange(75)[:, None] / HZ
    down = np.array([0, 0, -9.81])
    path = (0.5, 0, 1.0) + down / 2 * times**2
    fallen = recording(FLYING, {"ball": path}, velocities={"ball": down * times})
    (found,) = findings(FLYING, PANDA, ROD, fallen)
    assert found.text == "'ball' left the scene: it got to z = -42 m"
    path = straight((0.5, 0, 1.0), (9.38, 0, 1.0), 75)
    rolled = recording(FLYING, {"ball": path}, velocities={"ball": (3.0, 0, 0)})
    (found,) = findings(FLYING, PANDA, ROD, rolled)
    assert found.text == "'ball' is far away: it got to 9.4 m from the robot"


@pytest.mark.parametrize(
    ("velocity", "why"),
    [(1e4, "10000 m/s"), (np.nan, "not finite"), (np.inf, "not finite")],
)
def test_an_explosion_is_reported(velocity, why):
    taken = recording(
        FLYING,
        {"ball": np.tile((0.5, 0, 1), (5, 1))},
        velocities={"ball": (velocity, 0, 0)},
    )
    with pytest.raises(Explosion, match=why):
        findings(FLYING, PANDA, ROD, taken)


# --- what it costs ----------------------------------------------------------------------------------------------


class Fenced(Task):
    robot = PANDA
    name = "Fenced"
    description = "A ball before a wall."
    goals = (Placed(("ball",), place=(0.8, None, None)),)
    home = Pose.xyz_rpy((0.3, 0.0, 0.75))

    def scene(self, seed):
        return Scene((table(), WALL, body("ball", Sphere(0.02), (0.4, 0.0, 0.02))))

    def reward(self, start, end):
        return np.where(end.position("ball")[..., 0] > 0.5, 1.0, 0.25)


class Ghostly(Simulator):
    """The ball goes to 0.8 m, ahead through the wall or round it; every third time it explodes."""

    def __init__(self, way):
        self.way = way

    def rollout(self, task, jobs):
        return [self.one(task, job) for job in jobs]

    def one(self, task, job):
        scene = task.scene(job.seed)
        detour = [(0.4, 0, 0.02), (0.8, 0, 0.02)]
        if self.way == "over":
            detour[1:1] = [(0.4, 0, 0.8), (0.8, 0, 0.8)]
        path = np.vstack([straight(a, b, 20) for a, b in itertools.pairwise(detour)])
        velocity = (1e5 if self.way == "explosion" else 0.0, 0, 0)
        film = recording(scene, {"ball": path}, velocities={"ball": velocity})
        states = film.states
        return Outcome(
            states[0],
            states[-1],
            0.0,
            recording=film if job.record_hz else None,
            warnings=("it creaked",),
        )

    def render(self, task, **_):
        raise NotImplementedError


def earned(way, penetration):
    candidate = Candidate(ROD, np.array([[0.3, 0.0, 0.8, 0, 0, 0]]))
    (evaluation,) = evaluate_batch(
        Fenced(),
        Ghostly(way),
        [candidate],
        settings=RolloutSettings(penetration=penetration),
    )
    return evaluation


def test_by_default_penetration_earns_nothing_and_says_why():
    forbidden = earned("through", "forbid")
    assert (forbidden.status, forbidden.reward) == ("ok", 0.0)
    assert RolloutSettings().penetration == "forbid"
    assert forbidden.warnings[0] == "it creaked"
    for text in (forbidden.warnings[1], forbidden.reason):
        assert "'ball' passed through 'wall'" in text
    assert "1.00" in forbidden.reason


@pytest.mark.parametrize(
    ("way", "penetration", "warnings"),
    [("through", "warn", 2), ("through", "ignore", 1), ("over", "forbid", 1)],
)
def test_or_it_is_only_a_warning_or_not_looked_for_or_not_there(
    way, penetration, warnings
):
    found = earned(way, penetration)
    assert (found.reward, found.reason, len(found.warnings)) == (1.0, "", warnings)


def test_an_explosion_fails():
    failed = earned("explosion", "forbid")
    assert (failed.status, failed.reward) == ("failed", 0.0)
    assert "blew up: 'ball' reached 100000 m/s" in failed.reason


def test_a_wrong_choice_is_refused():
    with pytest.raises(UsageError, match=r"rollout\.penetration.*forbid, ignore, warn"):
        RolloutSettings(penetration="allow")


class Hurried(Fenced):
    """A heavy ball that flies at a thin wall, faster than a coarse time step can resolve."""

    name = "Hurried"

    def scene(self, seed):
        sheet = body("sheet", Box((0.5, 0.5, 0.004)), (0.6, 0.3, 0.3), mass=0.0)
        return Scene((sheet, body("ball", Sphere(0.01), (0.6, 0.3, 2.5))))

    def reward(self, start, end):
        return np.where(end.position("ball")[..., 2] < 0.2, 1.0, 0.0)


def test_what_a_real_engine_lets_through_is_found(monkeypatch):
    """A ball that falls two metres moves 12 cm in a step of 0.02 s, a sheet of 4 mm is nothing to it.

    So an engine takes finer steps for it, which it is kept from here.
    """
    candidate = Candidate(ROD, np.array([[0.3, 0.0, 0.75, 0, 0, 0]]))
    coarse = installed().create("sim", "pybullet", {"time_step": 0.02})
    fine = installed().create("sim", "pybullet", {"time_step": 0.001})
    settings = RolloutSettings(settle_s=0.0)
    (finer,) = evaluate_batch(Hurried(), coarse, [candidate], settings=settings)
    assert (finer.reason, finer.warnings) == ("", ())

    plainly = "plugins.simulators.fresh.choose_step"
    monkeypatch.setattr(plainly, lambda tool, scene, step, _: step)
    (through,) = evaluate_batch(Hurried(), coarse, [candidate], settings=settings)
    assert through.reward == 0.0
    assert "'ball' passed through 'sheet'" in through.reason
    (caught,) = evaluate_batch(Hurried(), fine, [candidate], settings=settings)
    assert (caught.reason, caught.warnings) == ("", ())


def test_a_recording_does_not_change_what_is_recorded():
    task = installed().create("task", "BringCube")
    still = Rollout(ROD, at_home(task), settle_s=0.2, hold_s=0.2)
    plain, filmed = (
        installed()
        .create("sim", "pybullet")
        .rollout(task, [still, replace(still, record_hz=HZ)])
    )
    assert np.array_equal(plain.end.positions, filmed.end.positions)


@pytest.mark.parametrize(
    ("over", "instants", "found"),
    [(0.013, 20, True), (0.013, 2, False), (0.002, 20, False)],
)
def test_a_joint_of_the_tool_that_stays_beyond_its_range_is_found(
    over, instants, found
):
    slider = ToolJoint("slider", (0.0, 0.0, 1.0), 0.0, 0.0065)
    (rod,) = ROD.components
    slide = replace(rod, name="slide", parent=rod.name, joint=slider)
    tool = replace(ROD, components=(rod, slide))
    taken = recording(FLYING, {"ball": np.tile((0.8, 0, 1.0), (100, 1))}, hz=50)
    places = np.zeros((100, 3))
    places[30 : 30 + instants, 2] = 0.0065 + over
    taken = replace(taken, fingers=places)
    said = [text for text in penetrations(FLYING, taken, tool) if "joint" in text]
    assert (
        said
        == ["'slide' went 0.013 m beyond the range of its joint from 0.60 s on"] * found
    )
