"""The files that a person takes away: the best tool to print, the motion to run, and a film of it."""

from __future__ import annotations

import csv
import io
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image as Pillow

from core.design import GRIPPER_MOUNTS, Candidate, Tool
from core.geometry import Pose
from core.interfaces import Image, Recording, RolloutSettings, Simulator, Task, ToolRepresentation
from core.reading import dump_design
from core.robot import FINGER_OPEN, assemble, tool_urdf
from core.rollout import prepare

if TYPE_CHECKING:
    import trimesh

FILM_HZ = 10


def save_picture(picture: Image, file: Path) -> None:
    """Write a picture (H, W, 3) as PNG."""
    Pillow.fromarray(picture).save(file)


def png(picture: Image) -> bytes:
    """A picture (H, W, 3) as the bytes of a PNG file."""
    buffer = io.BytesIO()
    Pillow.fromarray(picture).save(buffer, "PNG")
    return buffer.getvalue()


def save_design(candidate: Candidate, representation: ToolRepresentation, folder: Path) -> None:
    """Write ``design.json`` (a designs file), ``waypoints.csv``, ``tool.urdf``, ``robot.urdf`` with its meshes,
    ``tool.stl``.
    """
    tool = candidate.tool
    assert tool is not None
    folder.mkdir(parents=True, exist_ok=True)
    document = {"strategies": [dump_design(candidate, representation)]}
    (folder / "design.json").write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    with (folder / "waypoints.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        names = ["x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", "gripper"]
        writer.writerow(names[: candidate.plan.shape[1]])
        writer.writerows(candidate.plan.tolist())
    (folder / "tool.urdf").write_text(
        f'<robot name="tool">\n{_mounts(tool)}{tool_urdf(tool)}</robot>\n', encoding="utf-8"
    )
    (folder / "robot.urdf").write_text(assemble(tool, mesh_path=MeshCopier(folder)), encoding="utf-8")
    tool_mesh(tool).export(folder / "tool.stl")


def _mounts(tool: Tool) -> str:
    """The mount links, so that a tool's file stands alone: one root, and a second mount fixed to it."""
    first, *others = tool.mounts
    joints = (
        f'<joint name="{name}_joint" type="fixed"><parent link="{first}"/><child link="{name}"/></joint>\n'
        for name in others
    )
    return "".join(f'<link name="{name}"/>\n' for name in tool.mounts) + "".join(joints)


class MeshCopier:
    """Copies the arm's small collision meshes to ``meshes/`` beside a URDF, to be seen and felt, and names them
    relatively.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "meshes"
        self._folder.mkdir(exist_ok=True)

    def __call__(self, mesh: Path) -> str:
        small = mesh.parents[1] / "collision" / f"{mesh.stem}.stl"
        if not (self._folder / small.name).exists():
            shutil.copy(small, self._folder)
        return f"meshes/{small.name}"


def tool_mesh(tool: Tool) -> trimesh.Trimesh:
    """The boxes as one mesh in millimetres, as slicers expect; each mount's parts in that mount's frame, two mounts
    side by side.
    """
    import trimesh

    apart = {
        GRIPPER_MOUNTS[0]: Pose(np.array([0.0, FINGER_OPEN, 0.0])),
        GRIPPER_MOUNTS[1]: Pose(np.array([0.0, -FINGER_OPEN, 0.0])),
    }
    placed = tool.placed()
    boxes = []
    for component in tool.components:
        mount, pose = placed[component.name]
        boxes.append(component.shape.to_trimesh().apply_transform((apart.get(mount, Pose()) @ pose).matrix))
    return trimesh.util.concatenate(boxes).apply_scale(1000.0) if boxes else trimesh.Trimesh()


def save_film(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    file: Path,
    size: tuple[int, int] = (400, 300),
) -> None:
    """Play a candidate again and write what it does as an animated GIF, in its own time; ``size`` is width and height.

    Raises:
        ValueError: the rollout breaks.
    """
    recording = _recorded(task, simulator, candidate, seed, settings, FILM_HZ)
    frames = []
    for index in range(len(recording.times)):
        picture = _frame(task, simulator, candidate, seed, recording, index, size)
        frames.append(Pillow.fromarray(picture).quantize(96, dither=Pillow.Dither.NONE))
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=1000 // FILM_HZ, loop=0, optimize=True)


def draw_stages(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    size: tuple[int, int] = (640, 480),
) -> Image:
    """Play a candidate again and draw four instants of it in one picture of ``size``, in the order of reading: from the
    start of the motion to the end of the rollout, a third of the time apart.

    Raises:
        ValueError: the rollout breaks.
    """
    recording = _recorded(task, simulator, candidate, seed, settings, FILM_HZ)
    width, height = size[0] // 2, size[1] // 2
    stages = np.zeros((2 * height, 2 * width, 3), dtype=np.uint8)
    for number, time in enumerate(np.linspace(0.0, recording.times[-1], 4)):
        index = int(np.abs(recording.times - time).argmin())
        row, column = divmod(number, 2)
        picture = _frame(task, simulator, candidate, seed, recording, index, (width, height))
        stages[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture
    return stages


def _recorded(
    task: Task, simulator: Simulator, candidate: Candidate, seed: int, settings: RolloutSettings, hz: float
) -> Recording:
    _, job = prepare(task, candidate, seed, settings, record_hz=hz)
    outcome = simulator.rollout(task, [job])[0]
    if outcome.recording is None:
        raise ValueError(f"candidate {candidate.id} can't be filmed: {outcome.error}")
    return outcome.recording


def _frame(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    recording: Recording,
    index: int,
    size: tuple[int, int],
) -> Image:
    return simulator.render(
        task,
        seed=seed,
        tool=candidate.tool,
        arm=recording.arm[index],
        fingers=recording.fingers[index],
        state=recording.states[index],
        width=size[0],
        height=size[1],
    )
