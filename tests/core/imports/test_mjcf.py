"""The shapes of compiled MJCF: kinds, colours of geoms and materials, hulls."""

import mujoco
import numpy as np
import pytest

from core.geometry import Box, Capsule, Mesh
from core.imports.mjcf import MjcfShapes

MODEL = """
<mujoco>
  <asset>
    <material name="red" rgba="1 0 0 1"/>
    <mesh name="corner" vertex="0 0 0  1 0 0  0 1 0  0 0 1  0.2 0.2 0.2"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body>
      <freejoint/>
      <geom type="box" size="1 2 3" material="red"/>
      <geom type="capsule" size="0.1 0.2" material="red" rgba="0 1 0 1" friction="0.7"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3" contype="0" conaffinity="0" group="3"/>
      <geom type="mesh" mesh="corner"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def shapes():
    return MjcfShapes(mujoco.MjModel.from_xml_string(MODEL))


def test_each_geom_has_its_shape_and_what_it_does(shapes):
    box, capsule, ellipsoid, mesh = shapes.of_bodies(np.array([False, True]))
    assert box.shape == Box((2, 4, 6))
    assert capsule.shape == Capsule(0.1, 0.4)
    assert capsule.friction == 0.7
    assert box.collides
    assert box.drawn
    assert not ellipsoid.collides
    assert not ellipsoid.drawn
    assert np.ptp(ellipsoid.shape.vertices, axis=0) == pytest.approx((0.2, 0.4, 0.6))
    assert isinstance(mesh.solid, Mesh)
    assert len(mesh.solid.vertices) == 4  # without the corner within


def test_a_geoms_own_colour_goes_before_its_materials(shapes):
    box, capsule, *_ = shapes.of_bodies(np.array([False, True]))
    assert box.color == (1, 0, 0, 1)
    assert capsule.color == (0, 1, 0, 1)


def test_a_kind_that_is_not_read_has_no_shape(shapes):
    (plane,) = shapes.of_bodies(np.array([True, False]))
    assert (plane.kind, plane.shape, plane.solid) == ("plane", None, None)
