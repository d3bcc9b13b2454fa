"""Small tasks by hand."""

import numpy as np

from core.geometry import Box
from core.interfaces import Task
from core.scene import Body, Scene, table


class CubeOnTable(Task):
    """A cube on a table, with further bodies; nothing is rewarded."""

    name = "CubeOnTable"
    description = "A cube on a table."
    goals = ()

    def __init__(self, *bodies):
        shape = Box((0.07, 0.07, 0.07))
        cube = Body.of("cube", shape, (0.8, 0, 0.035), mass=1, color=(1, 0, 0, 1))
        self._bodies = (table(), cube, *bodies)

    def scene(self, seed):
        return Scene(self._bodies)

    def reward(self, start, end):
        return np.zeros(start.positions.shape[:-2])
