"""Draw a simulator's pictures, with its own renderer or another simulator's."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Unpack

import numpy as np
from PIL import Image as Pillow

from core.design import Tool
from core.errors import NoPicture, UserError
from core.geometry import Array
from core.interfaces import Image, Robot, Simulator, Task, View
from core.plugins import SIMULATOR, installed
from core.robot.description import joint_name
from core.robot.kinematics import arm_of
from core.scene import Camera, State

# Renderers draw hard edges; halving a picture of twice the size smooths them.
_OVERSAMPLING = 2
# Any thread may draw, but renderers draw one picture at a time.
_drawing = threading.RLock()


def joint_positions(
    robot: Robot, tool: Tool, arm: Array, fingers: Array
) -> dict[str, float]:
    """Name the positions of the joints that the robot has with a tool.

    Args:
        robot: the arm.
        tool: without the gripper, the fingers' positions are left out.
        arm: of the arm's joints (J,).
        fingers: of the fingers' and the tool's (F + K,).
    """
    if not tool.gripper:
        fingers = fingers[len(robot.finger_joints) :]

    loose = [joint_name(bearer.name) for bearer in tool.bearers]
    names = [*robot.joints(tool.gripper), *loose]
    return dict(zip(names, [*arm.tolist(), *fingers.tolist()], strict=False))


class Renderer(ABC):
    """Draw one scene after another; a loaded scene is kept until another one is needed."""

    name: str = ""  # for people: what it is, and the device it draws on
    _loaded: tuple[Task, int, Tool] | None = None

    @abstractmethod
    def load(self, task: Task, seed: int, tool: Tool) -> None:
        """Load the robot with a tool, and the scene of a layout."""

    @abstractmethod
    def pose(self, joints: Mapping[str, float], state: State) -> None:
        """Set the robot's joints, by their names, and the poses of the free bodies."""

    @abstractmethod
    def shoot(self, camera: Camera, width: int, height: int) -> Image:
        """Draw a picture (height, width, 3); its edges may be hard."""

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        """See `Simulator.render`."""
        seed = view.get("seed", 0)
        tool = view.get("tool")
        arm = view.get("arm")
        fingers = view.get("fingers")
        state = view.get("state")
        width = view.get("width", 640)
        height = view.get("height", 480)
        camera = view.get("camera") or task.camera

        if tool is None:
            tool = Tool(gripper=task.robot.gripper is not None)

        with _drawing:
            self._load_once(task, seed, tool)
            if arm is None:
                arm = arm_of(task.robot).home_for(task.home)
            if fingers is None:
                fingers = np.full(len(task.robot.finger_joints), task.robot.opening_m)
            if state is None:
                state = task.scene(seed).state()

            self.pose(joint_positions(task.robot, tool, arm, fingers), state)
            drawn = self.shoot(camera, width * _OVERSAMPLING, height * _OVERSAMPLING)

        picture = Pillow.fromarray(drawn)
        return np.asarray(picture.resize((width, height), Pillow.Resampling.LANCZOS))

    def _load_once(self, task: Task, seed: int, tool: Tool) -> None:
        loaded = self._loaded
        if loaded is not None and loaded[0] is task and loaded[1:] == (seed, tool):
            return

        self._loaded = None  # in case that loading fails
        self.load(task, seed, tool)
        self._loaded = (task, seed, tool)


class DrawingSimulator(Simulator):
    """Draw with the engine's own renderer or, if it has none or none here, with another simulator.

    The first picture decides which; ``drawn_by`` names it.
    """

    # Raises NoPicture with the reason if it can't be made.
    renderer: ClassVar[type[Renderer] | None] = None
    # The other simulator's name.
    stand_in: ClassVar[str] = "pybullet"
    _drawer: Renderer | Simulator | None = None

    def render(self, task: Task, **view: Unpack[View]) -> Image:
        """See `Simulator.render`.

        Raises:
            NoPicture: neither is available.
        """
        with _drawing:
            if self._drawer is None:
                self._drawer = self._choose()

        return self._drawer.render(task, **view)

    def _choose(self) -> Renderer | Simulator:
        missing = "the engine draws nothing itself"
        if self.renderer is not None:
            try:
                drawer = self.renderer()
            except NoPicture as error:
                missing = str(error)
            else:
                self.drawn_by = drawer.name
                return drawer

        try:
            other = installed().create(SIMULATOR, self.stand_in)
        except UserError as reason:
            raise NoPicture(
                f"{missing}, and {self.stand_in}'s can't stand in for it: {reason}"
            ) from reason

        self.drawn_by = f"{self.stand_in}'s renderer: {missing}"

        return other
