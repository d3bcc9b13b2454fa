"""A scene with a cube, a door and a drawer, and its start."""

from core.scene import (
    Body,
    Box,
    Joint,
    Scene,
)

RED = (1, 0, 0, 1)


DRAWER = Joint("drawer", "slider", "box", "case", axis=(-1, 0, 0), lower=0, upper=0.3)


DOOR = Joint(
    "door", "hinge", "leaf", axis=(0, 0, 1), origin=(0, -0.2, 0), lower=-2, upper=2
)


def body(name, position, mass=1.0):
    return Body.of(name, Box((0.1, 0.1, 0.1)), position, mass=mass, color=RED)


SCENE = Scene(
    (
        body("case", (0.8, 0, 0.1), 0.0),
        body("box", (0.8, 0, 0.1)),
        body("leaf", (0.4, 0.4, 0.2)),
        body("cube", (0.5, -0.3, 0.05)),
        body("other", (0.7, -0.3, 0.05)),
        Body.mark("mark", (0.5, 0.1, 0), 0.05, RED),
    ),
    (DRAWER, DOOR),
)


START = SCENE.state()


CUBE = ("cube",)
