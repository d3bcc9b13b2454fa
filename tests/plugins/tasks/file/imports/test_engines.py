"""What is imported moves as formulas say, in every engine: a mesh and a URDF."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.special import ellipk

from core.geometry import Pose
from core.interfaces import Rollout
from core.scene import Scene
from plugins.conformance.worlds import BARE, FAR, GRAVITY, Bodies, slope, still
from plugins.tasks.file.imports import read_mesh, read_urdf
from tests.engines import every_simulator, simulator

PENDULUM = """<robot name="pendulum">
  <link name="post"/>
  <link name="rod">
    <inertial><origin xyz="0 0 -0.2"/><mass value="0.5"/>
      <inertia ixx="0.006683" iyy="0.006683" izz="0.0000333" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.2"/><geometry><box size="0.02 0.02 0.4"/></geometry></collision>
  </link>
  <joint name="pivot" type="continuous"><parent link="post"/><child link="rod"/><axis xyz="1 0 0"/></joint>
</robot>"""


def played(engine, scene, seconds):
    """Instants, and the states at them."""
    task = Bodies(*scene.bodies, joints=scene.joints)
    (outcome,) = simulator(engine).rollout(task, [Rollout(BARE, still(), 0, 0.0, seconds, 100.0)])
    assert outcome.error is None
    return outcome.recording.times, scene.complete(outcome.recording.states)


@every_simulator
def test_a_pendulum_from_urdf_swings_in_its_period(engine, tmp_path):
    file = tmp_path / "pendulum.urdf"
    file.write_text(PENDULUM)
    tilted = Pose.xyz_rpy((*FAR[:2], 1.0), (1.0, 0.0, 0.0))
    read = read_urdf(file)
    bodies = tuple(replace(body, pose=tilted @ body.pose) for body in read.bodies)
    times, states = played(engine, Scene(bodies, read.joints), 3.0)
    angles = states.joint("pivot").position + 1.0  # from hanging
    down = np.flatnonzero(np.diff(np.sign(angles)))
    crossings = times[down] - angles[down] * np.diff(times)[down] / np.diff(angles)[down]
    inertia = 0.5 * (0.4**2 + 0.02**2) / 12 + 0.5 * 0.2**2
    due = 4 * math.sqrt(inertia / (0.5 * GRAVITY * 0.2)) * float(ellipk(math.sin(0.5) ** 2))
    assert 2 * np.diff(crossings).mean() == pytest.approx(due, rel=0.02)


@every_simulator
@pytest.mark.parametrize("suffix", ["obj", "stl"])
def test_a_mesh_slides_down_a_slope_as_its_friction_lets_it(engine, suffix, tmp_path):
    file = tmp_path / f"wedge.{suffix}"
    trimesh.creation.cylinder(radius=0.08, height=0.04, sections=24).export(file)
    tilt, friction = 0.5, 0.2
    plane = slope(tilt, friction)
    on_it = plane.pose @ Pose(np.array([-1.0, 0.0, 0.05 + 0.0202]))
    body = replace(read_mesh(file).bodies[0], mass=0.4, pose=on_it, friction=friction)
    times, states = played(engine, Scene((plane, body)), 0.8)
    way = float(np.linalg.norm(states.positions[-1, 0] - states.positions[20, 0]))
    pull = GRAVITY * (math.sin(tilt) - friction * math.cos(tilt))
    assert way == pytest.approx(pull * (times[-1] ** 2 - times[20] ** 2) / 2, rel=0.02)
