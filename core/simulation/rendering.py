"""Draw a simulator's pictures, with its own renderer or another simulator's."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Protocol, TypedDict, Unpack

import numpy as np

from core.design import Tool
from core.errors import NoPicture, UserError
from core.geometry import Array
from core.interfaces import Image, Simulator, Task
from core.plugins import installed
from core.robot.description import FINGER_OPEN
from core.robot.kinematics import arm as panda_arm
from core.scene import Camera, State

_drawing = threading.RLock()  # any thread may draw, but renderers draw one picture at a time


class View(TypedDict, total=False):
    """The keyword arguments of `Simulator.render`."""

    seed: int
    tool: Tool | None
    arm: Array | None
    fingers: Array | None
    state: State | None
    camera: Camera | None
    width: int
    height: int


class Renderer(Protocol):
    """Draw one scene after another; a loaded scene is kept until another one is needed."""

    def load(self, task: Task, seed: int, tool: Tool | None) -> None: ...

    def pose(self, arm: Array, fingers: Array, state: State) -> None:
        """Set the robot's joints, arm (7,) and fingers (2,), and the poses of the free bodies."""
        ...

    def shoot(self, camera: Camera, width: int, height: int) -> Image:
        """Draw a picture (height, width, 3)."""
        ...


class NamedRenderer(Renderer, Protocol):
    """A renderer with a ``name`` for people: what it is, and the device it draws on."""

    name: str


def draw(
    renderer: Renderer,
    task: Task,
    *,
    seed: int = 0,
    tool: Tool | None = None,
    arm: Array | None = None,
    fingers: Array | None = None,
    state: State | None = None,
    camera: Camera | None = None,
    width: int = 640,
    height: int = 480,
) -> Image:
    """Do what `Simulator.render` does, with a renderer."""
    with _drawing:
        renderer.load(task, seed, tool)
        renderer.pose(
            arm if arm is not None else panda_arm().home_for(task.home),
            fingers if fingers is not None else np.full(2, FINGER_OPEN),
            state if state is not None else task.scene(seed).state(),
        )
        return renderer.shoot(camera or task.camera, width, height)


class Pictures:
    """Draw with a simulator's own renderer or, if it is not available here, with another simulator.

    The first picture decides which.

    Args:
        make: makes the own renderer; raises NoPicture with the reason if it can't.
        stand_in: the other simulator's name.
    """

    def __init__(self, make: Callable[[], NamedRenderer], stand_in: str) -> None:
        self.drawn_by = ""  # see `Simulator.drawn_by`
        self._make = make
        self._stand_in = stand_in
        self._drawer: NamedRenderer | Simulator | None = None

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        """See `Simulator.render`.

        Raises:
            NoPicture: neither is available.
        """
        with _drawing:
            if self._drawer is None:
                self._drawer = self._choose()
        if isinstance(self._drawer, Simulator):
            return self._drawer.render(task, **view)
        return draw(self._drawer, task, **view)

    def _choose(self) -> NamedRenderer | Simulator:
        try:
            own = self._make()
        except NoPicture as missing:
            try:
                other: Simulator = installed().create("sim", self._stand_in)
            except UserError as reason:
                raise NoPicture(f"{missing}, and {self._stand_in}'s can't stand in for it: {reason}") from missing
            self.drawn_by = f"{self._stand_in}'s renderer: {missing}"
            return other
        self.drawn_by = own.name
        return own
