"""PushButton: push a button, beyond the arm's reach, back to its stop."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh

from core.geometry import Array
from core.goals import Placed
from core.interfaces import Task
from core.scene import Body, Box, Camera, Mesh, Scene, State, floor, table

START = (0.9, 0.0, 0.0)
TRAVEL = 0.1


@lru_cache(maxsize=1)
def button() -> Mesh:
    return Mesh.from_trimesh(
        trimesh.load_mesh(Path(__file__).parent / "assets/button.stl")
    )


class PushButton(Task):
    name = "PushButton"
    description = (
        "A red button with a diameter of 0.1 m stands on the table 0.9 m in front of the robot. Push it 0.1 m forward, "
        "against the grey stop."
    )
    goals = (
        Placed(
            bodies=("button",), place=(START[0] + TRAVEL, 0.0, None), tolerance=0.02
        ),
    )
    camera = Camera(position=(1.45, -1.1, 0.9), target=(0.6, 0.0, 0.2))

    def scene(self, seed: int) -> Scene:
        cap = Body.of("button", button(), START, mass=0.3, color=(0.8, 0.1, 0.1, 1.0))
        behind = START[0] + TRAVEL + 0.05 + 0.01
        stop = Body.of(
            "stop",
            Box((0.02, 0.3, 0.08)),
            (behind, 0.0, 0.04),
            mass=0.0,
            color=(0.5, 0.5, 0.5, 1.0),
        )
        return Scene((floor(), table(), stop, cap))

    def reward(self, start: State, end: State) -> Array:
        """The share of the way that is done."""
        way = end.position("button")[..., 0] - start.position("button")[..., 0]
        return np.clip(way / TRAVEL, 0.0, 1.0)
