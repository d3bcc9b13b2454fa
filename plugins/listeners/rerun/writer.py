"""The content of a recording.

There are two timelines. ``sim_time`` runs through the recorded rollouts, one after another, in simulated seconds;
``generation`` counts generations. Data of a generation begin on both timelines where its rollouts begin.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import trimesh
from scipy.spatial.transform import Rotation

from core.design import Candidate, Component, Tool
from core.events import Generation, Run
from core.geometry import Array, Pose
from core.interfaces import Outcome, Recording, Robot
from core.robot.kinematics import arm_of, link_frames
from core.robot.meshes import link_visuals, solids
from core.robot.trajectory import Motion
from core.scene import Camera, Color, Soft, State
from core.simulation.attempt import played, prepare
from core.support.templates import fill
from core.support.text import clean
from core.task import reward_of
from core.trial import Evaluation

_FLUSH_S, _END_S = 10.0, 5.0  # until all data are on the disk

_PAUSE_S = 0.5  # between two rollouts
_PATH_COLOR = (230, 120, 20)
_SERIES = {"best": (20, 120, 60), "mean": (40, 90, 200)}
_SHARP_RAD = np.radians(30.0)  # faces that meet at a wider angle are shaded apart

MAX_TEXT = 4000
_INDENT = (
    "    "  # before every line of a model's, so that it can't be taken for one of ours
)

_Place = tuple[str, ...]


class Writer:
    """Writes a run to a recording, the file ``recording.rrd`` in its folder.

    Raises:
        RuntimeError: Rerun can't write; by each method.
    """

    def __init__(self, run: Run, file: Path) -> None:
        self._run, self.task = run, run.task
        self._stream = rr.RecordingStream("vlmgineer")
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self._stream.set_sinks(rr.FileSink(file))
        self._stream.send_recording_name(f"{run.task.name}, {run.folder.name}")
        self._clock = 0.0
        self._mounted: set[_Place] = (
            set()
        )  # the meshes of the tool, and of the gripper if it has one
        self._robot = run.task.robot
        self._softs = {soft.name: soft for soft in run.task.scene(run.seed).softs}
        self._hand: dict[str, trimesh.Trimesh] = {}  # the gripper's links

    def begin(self) -> None:
        """Write what does not change: the layout, the scene and the arm."""
        self._stream.send_blueprint(layout(self._run.task.camera))
        self._scene()
        always = links(self._robot, gripper=False)
        both = links(self._robot, gripper=True) if self._robot.gripper else {}
        self._hand = {name: mesh for name, mesh in both.items() if name not in always}
        for name, mesh in always.items():
            self._log(("world", "robot", name), _mesh(mesh), static=True)
        for name, color in _SERIES.items():
            self._log(
                ("search", "reward", name),
                rr.SeriesLines(colors=color, names=name, widths=2.0),
                static=True,
            )
        self._flush()

    def generation(self, generation: Generation) -> None:
        """Write a generation's rewards."""
        self._at(generation.index)
        for name, reward in (
            ("best", generation.best_reward),
            ("mean", generation.mean_reward),
        ):
            if reward is not None:
                self._log(("search", "reward", name), rr.Scalars(reward))
        self._flush()

    def close(self) -> None:
        """End the recording. A disk that fails must not hold up the process at its exit."""
        ending = threading.Thread(target=self._stream.disconnect, daemon=True)
        ending.start()
        ending.join(_END_S)
        if ending.is_alive():
            rr.unregister_shutdown()

    def rollout(self, generation: int, evaluation: Evaluation, hz: float) -> None:
        """Write the arm, the tool and the scene in motion, the reward, and the model's description; or the reason why
        the rollout can't be shown.
        """
        candidate = evaluation.candidate
        assert candidate.tool is not None
        self._at(generation)
        try:
            motion, outcome, recording = replay(self._run, candidate, hz)
        except ValueError as error:
            note = f"the rollout can't be shown: {error}"
            self._write(
                "design", f"generation {generation}\n{design_text(evaluation, note)}"
            )
            self._flush()
            return
        self._write("design", f"generation {generation}\n{design_text(evaluation)}")
        self._mount(candidate.tool)
        arm = arm_of(self._robot)
        path = rr.LineStrips3D(
            [arm.positions(recording.arm)], colors=_PATH_COLOR, radii=0.002
        )
        self._log(("world", "path"), path)
        self._log(
            ("world", "waypoints"),
            rr.Points3D(motion.plan[:, :3], colors=_PATH_COLOR, radii=0.008),
        )
        ended = np.array(
            [motion.arrivals[guard.waypoint - 1] for guard in outcome.felt]
        )
        places = arm.positions(motion.trajectory.sample(ended)[0])
        self._log(
            ("world", "guards"),
            rr.Points3D(places, labels=[*map(str, outcome.felt)], radii=0.01),
        )

        times = recording.times - recording.times[0] + self._clock
        for name, poses in tracks(
            self._robot, candidate.tool, recording.arm, recording.fingers
        ).items():
            self._move(
                ("world", "robot", name), times, generation, poses[:, :3], poses[:, 3:]
            )
        states = recording.states
        for k, name in enumerate(states.names):
            if name in self._softs:
                self._deform(name, times, generation, states.nodes(name))
            else:
                w_last = np.roll(states.quaternions[:, k], -1, axis=-1)
                self._move(
                    ("world", "scene", name),
                    times,
                    generation,
                    states.positions[:, k],
                    w_last,
                )
        if outcome.start is not None and not self.task.reads_trace:
            scene = self.task.scene(self._run.seed)
            starts = State.stack([outcome.start] * len(times))
            rewards = reward_of(
                self.task, scene.complete(starts), scene.complete(states), None
            )
            self._columns(
                ("reward", candidate.id),
                times,
                generation,
                rr.Scalars.columns(scalars=rewards),
            )
        self._clock = float(times[-1]) + _PAUSE_S
        self._flush()

    def _deform(self, name: str, times: Array, generation: int, nodes: Array) -> None:
        """Write a soft body's surface, whose nodes are at ``nodes`` (T, N, 3)."""
        form = self._softs[name].form
        skins = np.stack([form.surface(places).vertices for places in nodes])
        vertices = rr.Mesh3D.columns(vertex_positions=skins.reshape(-1, 3))
        self._columns(
            ("world", "scene", name),
            times,
            generation,
            vertices.partition([skins.shape[1]] * len(times)),
        )

    def _scene(self) -> None:
        for body in self._run.task.scene(self._run.seed).bodies:
            path = ("world", "scene", body.name)
            if isinstance(body, Soft):
                faces, color = (
                    body.form.surface(body.placed).faces,
                    body.visuals[0].color,
                )
                self._log(
                    path,
                    rr.Mesh3D.from_fields(triangle_indices=faces, albedo_factor=color),
                    static=True,
                )
                continue
            if body.fixed:
                self._log(path, _transform(body.pose), static=True)
            for k, part in enumerate(body.visuals):
                mesh = shaded(part.shape.to_trimesh(), (*part.color[:3], 1.0))
                self._log(
                    (*path, f"part_{k}"),
                    _mesh(mesh, part.color[3]),
                    _transform(part.pose),
                    static=True,
                )

    def _mount(self, tool: Tool) -> None:
        """Show a tool, and the gripper if it has one, in the place of the last one."""
        robot = ("world", "robot")
        shown: dict[_Place, trimesh.Trimesh] = {
            (*robot, mount, "tool"): joined(parts)
            for mount, parts in solids(tool, loose=True).items()
        }
        if tool.gripper:
            shown |= {(*robot, name): mesh for name, mesh in self._hand.items()}
        for path in self._mounted - shown.keys():
            self._log(path, rr.Clear(recursive=True))
        for path, mesh in shown.items():
            self._log(path, _mesh(mesh))
        self._mounted = set(shown)

    def _at(self, generation: int) -> None:
        """Set the time of what is logged next."""
        self._stream.set_time("sim_time", duration=self._clock)
        self._stream.set_time("generation", sequence=generation)

    def _log(self, path: _Place, *what: rr.AsComponents, static: bool = False) -> None:
        """Log at the time that is set, or with ``static`` for all times."""
        self._stream.log(list(path), *what, static=static, strict=True)

    def _columns(
        self, path: _Place, times: Array, generation: int, columns: Any
    ) -> None:
        """Log many rows at once, at instants (T,) of ``sim_time``, all in one generation."""
        instants = rr.TimeColumn("sim_time", duration=times)
        same = rr.TimeColumn("generation", sequence=np.full(len(times), generation))
        self._stream.send_columns(
            rr.new_entity_path(list(path)), [instants, same], columns, strict=True
        )

    def _flush(self) -> None:
        """Wait until all data have arrived."""
        self._stream.flush(timeout_sec=_FLUSH_S)

    def _write(self, name: str, text: str) -> None:
        self._log(("text", name), rr.TextDocument(text, media_type=rr.MediaType.TEXT))

    def _move(
        self,
        path: _Place,
        times: Array,
        generation: int,
        positions: Array,
        quaternions: Array,
    ) -> None:
        poses = rr.Transform3D.columns(translation=positions, quaternion=quaternions)
        self._columns(path, times, generation, poses)


def layout(camera: Camera) -> rrb.Blueprint:
    """Arrange the viewer: the scene, the words and the rewards."""
    eye = rrb.EyeControls3D(
        position=camera.position, look_target=camera.target, eye_up=(0.0, 0.0, 1.0)
    )
    unit = rrb.ScalarAxis(range=(-0.05, 1.05))
    figures = rrb.Vertical(
        rrb.TextDocumentView(origin="/text/design", name="design"),
        rrb.TimeSeriesView(origin="/reward", name="reward in the rollout", axis_y=unit),
        rrb.TimeSeriesView(
            origin="/search/reward", name="reward by generation", axis_y=unit
        ),
        row_shares=[3, 2, 2],
    )
    scene = rrb.Spatial3DView(
        origin="/world", name="rollout", eye_controls=eye, line_grid=False
    )
    return rrb.Blueprint(
        rrb.Horizontal(scene, figures, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline="sim_time",
            fps=1.0,
            play_state="playing",
            loop_mode="all",
        ),
    )


def replay(
    run: Run, candidate: Candidate, hz: float
) -> tuple[Motion, Outcome, Recording]:
    """Play a candidate in the run's own simulator, in this process.

    Raises:
        ValueError: the rollout breaks, or the run has no simulator.
    """
    if run.simulator is None:
        raise ValueError("the run has no simulator to play it with")
    motion, job = prepare(run.task, candidate, run.seed, run.settings, record_hz=hz)
    outcome = run.simulator.rollout(run.task, [job])[0]
    if outcome.recording is None:
        raise ValueError(outcome.error or "no recording came back")
    return played(motion, job), outcome, outcome.recording


def shaded(solid: trimesh.Trimesh, color: Color) -> trimesh.Trimesh:
    """The solid with a normal and a colour at each vertex."""
    mesh = trimesh.graph.smooth_shade(solid, angle=_SHARP_RAD)
    mesh.visual.vertex_colors = np.clip(color, 0.0, 1.0)
    return mesh


def joined(solids: Iterable[tuple[Component, trimesh.Trimesh]]) -> trimesh.Trimesh:
    """Components as one mesh, in their colours."""
    return trimesh.util.concatenate(
        [shaded(solid, component.color) for component, solid in solids]
    )


def _transform(pose: Pose) -> rr.Transform3D:
    return rr.Transform3D(
        translation=pose.position, quaternion=np.roll(pose.quaternion, -1)
    )


def _mesh(solid: trimesh.Trimesh, opacity: float = 1.0) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=solid.vertices,
        triangle_indices=solid.faces,
        vertex_normals=solid.vertex_normals,
        vertex_colors=solid.visual.vertex_colors,
        albedo_factor=(1.0, 1.0, 1.0, opacity),
    )


def links(robot: Robot, gripper: bool) -> dict[str, trimesh.Trimesh]:
    """The visual mesh of each link of the bare arm, in the link's frame; with the gripper, or without."""
    meshes = {}
    for name, visuals in link_visuals(robot, gripper).items():
        pieces = []
        for shape, pose, color in visuals:
            mesh = shape.to_trimesh()
            pieces.append(
                trimesh.Trimesh(
                    mesh.vertices, mesh.faces, vertex_colors=color
                ).apply_transform(pose.matrix)
            )
        meshes[name] = trimesh.util.concatenate(pieces)
    return meshes


def tracks(robot: Robot, tool: Tool, arm: Array, fingers: Array) -> dict[str, Array]:
    """The motion of each link in the world, at arm joints (T, J) and fingers with the tool's joints (T, F + K).

    Each is (T, 7): x, y, z in metres, then a quaternion (x, y, z, w), as Rerun has them.
    """
    frames = link_frames(robot, tool, arm, fingers)
    return {
        name: np.hstack([positions, Rotation.from_matrix(rotations).as_quat()])
        for name, (rotations, positions) in frames.items()
    }


def design_text(evaluation: Evaluation, note: str = "") -> str:
    """The text beside a candidate.

    It is shown as plain text, never as Markdown, which can fetch pictures and hide the targets of links.
    """
    candidate = evaluation.candidate
    parts = candidate.tool.components if candidate.tool is not None else ()
    given = {
        "evaluation": evaluation,
        "candidate": candidate,
        "note": note,
        "parts": parts,
    }
    return fill("plugins.listeners.rerun", "design", **given, quoted=_quoted)


def _quoted(*texts: str) -> str:
    lines = [
        line
        for text in texts
        for line in clean(text, MAX_TEXT, lines=True).splitlines()
    ]
    return "\n".join(f"{_INDENT}{line}" for line in lines or ["(nothing)"])
