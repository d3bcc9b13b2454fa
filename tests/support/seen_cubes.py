"""Cubes, and the entries of plans that look at them."""

from dataclasses import replace

from core.geometry import Box
from core.goals import Placed
from core.scene import Body
from plugins.conformance.worlds import GREY, HOME, Bodies

CUBES = {"cube_1": (0.5, 0.2), "cube_2": (0.55, -0.2)}


MARK = Body.mark("mark", (0.6, 0.0, 0.0), 0.05, GREY)


FLOOR = Body.of("floor", Box((2, 2, 0.1)), (0.0, 0.0, -0.05), mass=0.0, color=GREY)


LOOK = {"look": True}


HIGH = {"offset": [0.45, 0.0, 0.5]}


OVER = {"anchor": "cube_1", "offset": [0.0, 0.0, 0.35]}


def cube(name, x, y, **more):
    shape = Box((0.04, 0.04, 0.04))
    made = Body.of(name, shape, (x, y, 0.02), mass=0.1, color=GREY)
    return replace(made, **more)


class Cubes(Bodies):
    """Two cubes, and a mark to which both are to get."""

    home = HOME
    goals = (Placed(tuple(CUBES), place=(0.0, 0.0, 0.02), at="mark"),)

    def __init__(self, **more):
        cubes = [cube(name, *place, **more) for name, place in CUBES.items()]
        super().__init__(*cubes, MARK, FLOOR)
