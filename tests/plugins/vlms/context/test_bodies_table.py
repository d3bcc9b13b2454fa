"""Bodies without a number: how they move, what they weigh, and where their origin is."""

import numpy as np

from core.geometry import Box, Pose
from core.interfaces import Task
from core.scene import Body, Scene
from plugins.vlms.context.bodies_table import bodies_table, bounds, bounds_in_world

BOX = Body.of("box", Box((0.1, 0.2, 0.3)), (0.5, 0, 0.15), mass=1, color=(1, 0, 0, 1))
FRAME = Body("frame", Pose(np.array([0.7, 0.1, 0.2])), 0.0, (), ())


class Framed(Task):
    """A box, and a frame without a shape, as imported files have them."""

    name = "Framed"
    description = "Nothing happens."
    goals = ()

    def scene(self, seed):
        return Scene((BOX, FRAME))

    def reward(self, start, end):
        return np.zeros(len(end.positions))


def test_a_body_without_a_shape_is_as_large_as_its_origin():
    low, high = bounds(FRAME, FRAME.pose)
    assert low.tolist() == high.tolist() == [0.7, 0.1, 0.2]

    low, high = bounds_in_world([BOX, FRAME])
    assert np.allclose(low, [0.45, -0.1, 0.0])
    assert np.allclose(high, [0.7, 0.1, 0.3])


def test_its_origin_is_its_centre():
    _, _, box, frame = bodies_table(Framed(), 0).splitlines()
    assert box.startswith("| box |")
    assert box.endswith("| centre |")
    assert frame.startswith("| frame |")
    assert frame.endswith("| centre |")
