"""Descriptions of compiled MJCF: kinds of shapes, colours of geoms and materials, joints and frames."""

import math

import mujoco
import numpy as np
import pytest

from core.geometry import Box, Capsule, Mesh
from core.imports.mjcf import WORLD, describe_model

MODEL = """
<mujoco>
  <asset>
    <material name="red" rgba="1 0 0 1"/>
    <mesh name="corner" vertex="0 0 0  1 0 0  0 1 0  0 0 1  0.2 0.2 0.2"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="thing">
      <freejoint/>
      <geom type="box" size="1 2 3" material="red"/>
      <geom type="capsule" size="0.1 0.2" material="red" rgba="0 1 0 1" friction="0.7"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3" contype="0" conaffinity="0"/>
      <geom type="mesh" mesh="corner" group="3"/>
      <body name="door" pos="1 0 0">
        <joint name="hinge" axis="0 0 1" pos="0 0.5 0" ref="30" range="-90 90" armature="0.1" damping="2"/>
        <geom size="0.1" mass="2"/>
        <site name="handle" pos="0 -0.5 0"/>
        <site name="mark"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def described():
    model = mujoco.MjModel.from_xml_string(MODEL)
    return describe_model(model, "all", lambda site: site == "handle")


def test_each_geom_has_its_shape_and_what_it_does(described):
    thing = described[0].links["thing"]
    box, capsule, mesh = thing.collisions
    assert box.shape == Box((2, 4, 6))
    assert capsule.shape == Capsule(0.1, 0.4)
    assert capsule.friction == 0.7
    assert isinstance(mesh.shape, Mesh)
    assert mesh not in thing.visuals
    ellipsoid = thing.visuals[2]
    assert np.ptp(ellipsoid.shape.vertices, axis=0) == pytest.approx((0.2, 0.4, 0.6))


def test_a_geoms_own_colour_goes_before_its_materials(described):
    box, capsule, *_ = described[0].links["thing"].collisions
    assert box.color == (1, 0, 0, 1)
    assert capsule.color == (0, 1, 0, 1)


def test_a_joint_is_described_at_0_about_its_own_place(described):
    arm, notes = described
    joint = arm.named["hinge"]
    assert (joint.kind, joint.armature, joint.damping) == ("revolute", 0.1, 2.0)
    assert joint.range == pytest.approx((-math.pi / 2, math.pi / 2))
    assert joint.start == pytest.approx(math.radians(30))
    assert joint.origin.rpy[2] == pytest.approx(-math.radians(30))
    assert joint.origin.xyz == pytest.approx((1, 0.5, 0))
    assert arm.links["door"].frame == (0, -0.5, 0)
    assert arm.joints["thing"].kind == "floating"
    assert notes == ["left out: 1 geom plane"]


def test_only_frames_that_are_wanted_are_links(described):
    arm, _ = described
    assert [*arm.links] == [WORLD, "thing", "door", "handle"]
    assert arm.joints["handle"].origin.xyz == (0, -1, 0)
