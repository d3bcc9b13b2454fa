"""What is written for a small arm that is simulated larger: all of it is in the arm's own size."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
import yaml

from core.design import Component, Tool
from core.designs.planning import resolve
from core.errors import UserError
from core.geometry import Box, Pose
from core.interfaces import JointTrajectory, RolloutSettings
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_task_motion
from core.values.printers import Printer
from core.values.tools import Fixture, ToolJoint
from plugins.results.workshop.carrying import carry_out
from plugins.results.workshop.clearance import clearance
from plugins.results.workshop.examination import Examination
from plugins.results.workshop.export_command import configured, export
from plugins.results.workshop.life_size import Ratio, to_life
from plugins.results.workshop.motion import sample, to_csv
from plugins.results.workshop.replay import play_motion
from plugins.robots.enlarging import enlarge
from plugins.robots.own_arm import read_robot
from tests.support import carried, scara
from tests.support.carried import TOUCH_Z, Exact, cubes, exported
from tests.support.guarded_blocks import ABOVE, DOWN, UP, Block
from tests.support.outside_arm import FLANGE, HOME, write_arm
from tests.support.panda import PANDA
from tests.support.playing import condition
from tests.support.seen_cubes import HIGH, LOOK, OVER, Cubes

pytestmark = pytest.mark.slow

K = 2.0
LARGER = Ratio(K)


def box(size, mass, joint=None, name="part", parent="tool_mount", at=(0.0, 0.0, -0.1)):
    return Component(name, parent, Pose(np.array(at)), Box(size), mass, joint=joint)


def test_a_joint_that_slides_is_as_much_shorter(tmp_path):
    """So the arm in the lab reaches the same place, as much nearer."""
    file = scara.write(tmp_path / "scara.urdf")
    large = read_robot(file, scara.HOME, "tool0", reach=0.8 / K)
    life = to_life(large)
    turned = np.add(large.home, [0.2, 0.1, 0.3, -0.4])
    far = arm_of(large).forward(turned)
    near = arm_of(large.life_size).forward(life.joints(turned))
    np.testing.assert_allclose(near.position, far.position / K, atol=1e-5)

    played = sample(
        JointTrajectory(
            np.array([0.0, 2.0]), np.array([large.home, turned]), np.zeros(2)
        ),
        arm_of(large),
        100,
    )
    small = life.samples(played)
    np.testing.assert_allclose(
        small.positions, life.joints(played.positions), atol=1e-12
    )
    # The speeds are those of the positions.
    rates = np.gradient(small.positions, small.times, axis=0)
    np.testing.assert_allclose(rates[5:-5], small.velocities[5:-5], atol=5e-3)
    header = to_csv(small, large.life_size).splitlines()[0].split(",")
    assert [header[3], header[7], header[11]] == ["j3_m", "j3_m_s", "j3_m_s2"]
    assert life.inverse.joints(life.joints(turned)) == pytest.approx(turned)


# --- numbers ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["hinge", "slider"])
def test_a_tool_that_is_larger_swings_as_much_slower(kind):
    """What a spring and gravity do to it takes √k times as long, and its damping ratio stays."""
    joint = ToolJoint(
        kind, (0, 1, 0), -0.1, 0.2, (0.01, 0, 0), 0.3, 0.4, 5.0, rest=0.02
    )
    tool = Tool((box((0.1, 0.02, 0.03), 0.2), box((0.1, 0.02, 0.03), 0.1, joint, "b")))
    larger = LARGER.tool(tool)

    def period(part):
        mass = part.mass
        if kind == "hinge":
            mass = part.shape.inertia(part.mass)[1][1, 1]
        return math.sqrt(mass / part.joint.stiffness), mass

    (before, mass), (after, larger_mass) = map(
        period, (tool.components[1], larger.components[1])
    )
    assert after == pytest.approx(math.sqrt(K) * before)
    dampings = [
        part.joint.damping * time / inertia
        for part, time, inertia in (
            (tool.components[1], before, mass),
            (larger.components[1], after, larger_mass),
        )
    ]
    assert dampings[1] == pytest.approx(dampings[0])
    way = 1.0 if kind == "hinge" else K
    after = larger.components[1].joint
    assert (after.lower, after.upper, after.rest) == (-0.1 * way, 0.2 * way, 0.02 * way)
    assert after.friction / joint.friction == pytest.approx(K**4 / way)
    assert after.origin == (0.02, 0.0, 0.0)
    assert larger.mass == pytest.approx(K**3 * tool.mass)
    assert larger.components[0].shape.size == (0.2, 0.04, 0.06)
    again = LARGER.inverse.tool(larger).components[1]
    assert (again.mass, again.shape) == (0.1, tool.components[1].shape)
    assert again.joint.damping == pytest.approx(0.3)


def test_a_fixture_grows_with_the_tool():
    parts = Tool((box((0.1, 0.1, 0.02), 0.05, at=(0, 0, 0)),))
    tool = replace(
        Tool((box((0.1, 0.02, 0.02), 0.1),)),
        fixture=Fixture(parts, Pose(np.array([0.5, 0.1, 0.0]))),
    )
    fixture = LARGER.tool(tool).fixture
    assert fixture.pose.position.tolist() == [1.0, 0.2, 0.0]
    assert fixture.parts.components[0].shape.size == (0.2, 0.2, 0.04)


def test_an_arm_of_its_own_size_is_not_converted():
    tool = Tool((box((0.1, 0.02, 0.02), 0.1),))
    assert PANDA.life_size is PANDA
    assert to_life(PANDA).tool(tool) is tool


# --- an arm of half the size ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Export a design of the outside arm, as if it were half as large as what does the task."""
    folder = tmp_path_factory.mktemp("small")
    words = [
        "designs=tests/tasks/solutions/BringCube.json",
        "task=BringCube",
        "tool=urdf",
        "robot=urdf",
        f"robot.path={write_arm(folder)}",
        f"robot.flange={FLANGE}",
        f"robot.home=[{','.join(map(str, HOME))}]",
        "robot.reach=0.4",
        "material=pla",
        "sims=[mujoco]",
        "rate_hz=500",
        f"output={folder / 'export'}",
    ]
    (found,) = export(configured(words))
    return folder / "export", found


@pytest.fixture(scope="module")
def simulated(made):
    """What the same motion does in the simulated size."""
    _, found = made
    robot = found.task.robot
    scene = found.task.scene(0)
    large = to_life(robot).inverse
    tool = found.candidate.tool
    where = condition(found.task, installed().create("sim", "mujoco"))
    return play_motion(where, scene, tool, large.trajectory(found.motion.trajectory))


def test_the_motion_is_that_of_the_arm_itself(made, simulated):
    folder, found = made
    arm = arm_of(found.robot)
    assert found.robot == found.task.robot.original
    assert found.robot.title == "outside arm"
    table = np.genfromtxt(folder / "motion/trajectory.csv", delimiter=",", names=True)
    assert table["time_s"][1] == pytest.approx(1 / 500)
    task = found.task
    settings = RolloutSettings()
    waypoints = resolve(found.candidate.plan, task, 0, settings)
    planned = plan_task_motion(waypoints, task, settings).trajectory
    seconds = found.motion.slower * planned.duration / K**0.5
    assert table["time_s"][-1] == pytest.approx(seconds, abs=0.03)
    speeds = np.abs(found.motion.velocities).max(axis=0)
    assert (speeds <= arm.velocity_limits).all()
    robot = task.robot
    shares = to_life(robot).inverse.samples(found.motion).loads(arm_of(robot))
    assert np.allclose(found.motion.loads(arm), shares)
    step = np.diff(found.motion.positions, axis=0) * 500
    assert np.allclose(step, found.motion.velocities[1:], atol=0.05)
    assert found.replays["mujoco"].reward == pytest.approx(simulated.reward)
    assert found.contact_s == pytest.approx(simulated.contact_s / 2**0.5)


def test_the_tool_the_loads_and_the_payload_are_in_the_size_of_the_arm_itself(
    made, simulated
):
    folder, found = made
    searched = found.candidate.tool
    own = found.printed.tool
    for large, small in zip(searched.components, own.components, strict=True):
        assert np.allclose(small.shape.bounds[1], large.shape.bounds[1] / 2)
        assert np.allclose(small.pose.position, large.pose.position / 2)
        assert small.mass == pytest.approx(large.mass / 8)

    sheet = json.loads((folder / "sheet.json").read_text())
    sizes = {row["name"]: row["size_mm"] for row in sheet["parts"]}
    for component in searched.components:
        half = 500 * component.shape.bounds[1]
        assert sizes[component.name] == pytest.approx(half, abs=0.06)

    # The plate at the flange is of the arm's own screws, and not half as large.
    plates = [c for c in found.printed.mounted.components if c.name not in sizes]
    assert max(plate.shape.bounds[1][:2].max() for plate in plates) > 0.06
    assert sheet["mass_kg"] == pytest.approx(found.printed.printed.mass, abs=1e-5)
    forces = found.replays["mujoco"].recording.forces
    for names, values in simulated.recording.forces.items():
        assert np.allclose(forces[names], values / 8)
    pushed = found.replays["mujoco"].recording.pushes
    assert np.allclose(pushed.points, simulated.recording.pushes.points / 2)

    text = (folder / "CHECKLIST.md").read_text()
    assert "fix it to the outside arm, and" in text
    forces = simulated.recording.forces
    hardest = max(rows.max() for names, rows in forces.items() if names[0] == "tool")
    assert f"It presses with {hardest / 8:.1f} N at most" in text


def test_the_scene_the_distances_and_the_files_are_in_the_size_of_the_arm_itself(
    made, simulated
):
    folder, found = made
    scene = found.task.scene(0)
    bodies = {body.name: body for body in scene.bodies}
    data = yaml.safe_load((folder / "ros2/scene.yaml").read_text())
    for item in data["world"]["collision_objects"]:
        body = bodies[item["id"]]
        place = list(item["pose"]["position"].values())
        assert place == pytest.approx(body.pose.position / 2, abs=1e-6)
        for part, shown in zip(
            body.collisions, item.get("primitives", []), strict=True
        ):
            assert shown["dimensions"] == pytest.approx(np.array(part.shape.size) / 2)

    robot = found.task.robot
    rows = clearance(scene, robot, found.candidate.tool, simulated.recording)
    large = {(row.what, row.to): row for row in rows}
    for row in found.nearest:
        was = large[row.what, row.to]
        if max(row.metres, was.metres) < 0.14:
            assert row.metres == pytest.approx(was.metres / 2, abs=2e-3)

    with (folder / "design/waypoints.csv").open() as file:
        _, *lines = csv.reader(file)
    assert len(lines) == len(found.planned.plan)
    urdf = trimesh.load(folder / "design/tool.stl")
    corners = np.vstack(
        [
            1000 * part.pose.apply(part.shape.corners)
            for part in found.printed.tool.parts
        ]
    )
    assert urdf.extents == pytest.approx(np.ptp(corners, axis=0), abs=1.5)


def test_a_tool_is_refused_by_what_the_arm_itself_needs(made):
    _, found = made
    where = condition(found.task, installed().create("sim", "mujoco"))
    for wall_mm, printable in ((3.0, True), (3.4, False)):  # it is 3.17 mm thin
        printer = Printer((400.0, 400.0, 400.0), wall_mm)
        examination = Examination(found.printed.material, printer, 2.0, 0.005)
        refused = examination.refuse(where, found.candidate) or ""
        assert ("walls" not in refused) == printable, refused


def test_soft_bodies_have_no_other_size():
    with pytest.raises(UserError, match="rope is soft"):
        Ratio(0.5).scene(installed().create("task", "PullRope").scene(0))


# --- a plan that feels ------------------------------------------------------------------------------------------------


def halved(task):
    """A task that an arm of half the size of its own does."""
    task.robot = replace(task.robot, enlarged=K, original=enlarge(task.robot, 1 / K))
    return task


def test_a_plan_that_feels_runs_on_an_arm_of_half_the_size(monkeypatch):
    """It feels the touch at half the height, in √2 of the time and with an eighth of the force."""
    monkeypatch.setattr(carried, "TOUCH_Z", TOUCH_Z / K)
    monkeypatch.setattr(carried, "PUSH_N", carried.PUSH_N / K**3)
    task = halved(Block())
    driver = Exact(arm_of(task.robot.life_size))
    policy = carry_out(exported(task, ABOVE, DOWN, UP), driver, dict)
    heights = [place[2] for place in driver.places]
    assert len(policy.felt) == 1
    np.testing.assert_allclose(heights, [TOUCH_Z / K, (TOUCH_Z + 0.05) / K], atol=0.002)
    assert policy.seconds / driver.seconds == pytest.approx(K**0.5, rel=0.02)


def test_a_plan_that_looks_sees_half_as_far():
    seen = cubes(cube_1=(0.45, 0.1))
    half = {
        name: [value / K for value in row[:3]] + row[3:] for name, row in seen.items()
    }
    task = halved(Cubes())
    driver = Exact(arm_of(task.robot.life_size))
    waits = []
    carry_out(
        exported(task, HIGH, LOOK, OVER),
        driver,
        lambda: half,
        clock=lambda: driver.seconds,
        wait=waits.append,
    )
    np.testing.assert_allclose(driver.places[-1], [0.225, 0.05, 0.185], atol=1e-3)
    assert waits == [pytest.approx(0.5 / K**0.5)]
