"""The content of a recording.

There are two timelines. ``sim_time`` runs through the recorded rollouts, one after another, in simulated seconds;
``generation`` counts generations. Data of a generation begin on both timelines where its rollouts begin.
"""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import trimesh
from scipy.spatial.transform import Rotation

from core.design import Candidate, Tool
from core.events import Generation, Run
from core.geometry import Array
from core.interfaces import Felt, Looked, Motion, Outcome, Recording
from core.robot.kinematics import arm_of, link_frames
from core.scene import Soft, State
from core.simulation.attempt import prepare
from core.task import reward_of
from core.trial import Evaluation
from plugins.listeners.rerun.archetypes import (
    links,
    shaded,
    to_mesh,
    to_transform,
)
from plugins.listeners.rerun.blueprint import design_text, layout

_FLUSH_S = 10.0  # until all data are on the disk
_END_S = 5.0
_PAUSE_S = 0.5  # between two rollouts
_PATH_COLOR = (230, 120, 20)
_SERIES = {"best": (20, 120, 60), "mean": (40, 90, 200)}

_Place = tuple[str, ...]
_ROBOT: _Place = ("world", "robot")
_SCENE: _Place = ("world", "scene")


class Writer:
    """Writes the recording of a run for the Rerun viewer.

    One writer has one task and one file. Call `begin` first, then `generation` and `rollout` as often as needed, and
    `close` at the end. Each method waits until its data are on the disk, and all belong to one thread.

    Args:
        run: what is recorded.
        file: where to.

    Raises:
        RuntimeError: Rerun can't write; by each method.
    """

    def __init__(self, run: Run, file: Path) -> None:
        self.task = run.task
        self._run = run
        self._stream = rr.RecordingStream("vlmgineer")
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)
        self._stream.set_sinks(rr.FileSink(file))
        self._stream.send_recording_name(f"{run.task.name}, {run.folder.name}")
        self._clock = 0.0
        self._robot = run.task.robot
        self._scene = run.task.scene(run.seed)
        self._hand: dict[str, trimesh.Trimesh] = {}  # the gripper's links
        self._mounted: set[_Place] = set()  # meshes of the tool, and of its gripper

    def begin(self) -> None:
        """Write what does not change: the layout, the scene and the arm."""
        self._stream.send_blueprint(layout(self.task.camera))
        self._show_scene()
        arm = links(self._robot, gripper=False)
        for name, mesh in arm.items():
            self._log((*_ROBOT, name), to_mesh(mesh), static=True)

        if self._robot.gripper:
            both = links(self._robot, gripper=True)
            self._hand = {name: both[name] for name in both if name not in arm}

        for name, color in _SERIES.items():
            series = rr.SeriesLines(colors=color, names=name, widths=2.0)
            self._log(("search", "reward", name), series, static=True)

        self._flush()

    def generation(self, generation: Generation) -> None:
        """Write a generation's rewards."""
        self._set_time(generation.index)
        rewards = {"best": generation.best_reward, "mean": generation.mean_reward}
        for name, reward in rewards.items():
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
        """Write the arm, the tool and the scene in motion, the reward, and the model's description.

        Where the rollout can't be shown, its reason is written.

        Args:
            generation: the number of the candidate's.
            evaluation: the candidate, which has a tool.
            hz: frames per simulated second.
        """
        candidate = evaluation.candidate
        assert candidate.tool is not None
        self._set_time(generation)

        try:
            motion, outcome, recording = replay(self._run, candidate, hz)
        except ValueError as error:
            note = f"the rollout can't be shown: {error}"
            self._show_words(generation, design_text(evaluation, note))
            self._flush()
            return

        self._show_words(generation, design_text(evaluation))
        self._mount(candidate.tool)
        self._show_way(motion, outcome, recording)
        times = recording.times - recording.times[0] + self._clock
        instants = [
            rr.TimeColumn("sim_time", duration=times),
            rr.TimeColumn("generation", sequence=np.full(len(times), generation)),
        ]
        self._move_robot(instants, candidate.tool, recording)
        self._move_scene(instants, recording.states)

        if outcome.start is not None and not self.task.reads_trace:
            rewards = self._reward_over_time(outcome.start, recording.states)
            columns = rr.Scalars.columns(scalars=rewards)
            self._log_rows(("reward", candidate.id), instants, columns)

        self._clock = float(times[-1]) + _PAUSE_S
        self._flush()

    def _show_words(self, generation: int, text: str) -> None:
        """Write the text beside a candidate."""
        words = f"generation {generation}\n{text}"
        document = rr.TextDocument(words, media_type=rr.MediaType.TEXT)
        self._log(("text", "design"), document)

    def _show_scene(self) -> None:
        """Show the bodies of the scene: what is fixed in its place, soft ones as their surface."""
        for body in self._scene.bodies:
            path = (*_SCENE, body.name)
            if isinstance(body, Soft):
                skin = rr.Mesh3D.from_fields(
                    triangle_indices=body.form.surface(body.placed).faces,
                    albedo_factor=body.visuals[0].color,
                )
                self._log(path, skin, static=True)
                continue

            if body.fixed:
                self._log(path, to_transform(body.pose), static=True)

            for k, part in enumerate(body.visuals):
                red, green, blue, opacity = part.color
                mesh = shaded(part.shape.to_trimesh(), (red, green, blue, 1.0))
                self._log(
                    (*path, f"part_{k}"),
                    to_mesh(mesh, opacity),
                    to_transform(part.pose),
                    static=True,
                )

    def _mount(self, tool: Tool) -> None:
        """Show a tool, and the gripper if it has one, in the place of the last one."""
        pieces = defaultdict(list)
        for component in tool.components:
            bearer, pose = tool.borne[component.name]
            solid = component.shape.to_trimesh().apply_transform(pose.matrix)
            pieces[bearer].append(shaded(solid, component.color))

        shown: dict[_Place, trimesh.Trimesh] = {}
        for bearer, meshes in pieces.items():
            shown[*_ROBOT, bearer, "tool"] = trimesh.util.concatenate(meshes)

        if tool.gripper:
            for name, mesh in self._hand.items():
                shown[*_ROBOT, name] = mesh
        if tool.fixture is not None:
            body = self._scene.furnished(tool).bodies[-1]
            parts = []
            for part in body.visuals:
                placed = body.pose @ part.pose
                solid = part.shape.to_trimesh().apply_transform(placed.matrix)
                parts.append(shaded(solid, part.color))

            shown[*_SCENE, body.name] = trimesh.util.concatenate(parts)

        for path in self._mounted - shown.keys():
            self._log(path, rr.Clear(recursive=True))

        for path, mesh in shown.items():
            self._log(path, to_mesh(mesh))

        self._mounted = set(shown)

    def _show_way(self, motion: Motion, outcome: Outcome, recording: Recording) -> None:
        """Show where the end-effector goes, its waypoints, where guards ended, and where a plan looked."""
        arm = arm_of(self._robot)
        way = [arm.positions(recording.arm)]
        strip = rr.LineStrips3D(way, colors=_PATH_COLOR, radii=0.002)
        self._log(("world", "path"), strip)
        waypoints = motion.plan[:, :3]
        points = rr.Points3D(waypoints, colors=_PATH_COLOR, radii=0.008)
        self._log(("world", "waypoints"), points)

        ended = [motion.arrivals[guard.waypoint - 1] for guard in outcome.felt]
        self._mark("guards", motion, ended, outcome.felt)
        looked = [look.at_s for look in outcome.looked]
        self._mark("looks", motion, looked, outcome.looked)

    def _mark(
        self,
        name: str,
        motion: Motion,
        instants: Sequence[float],
        what: Sequence[Felt | Looked],
    ) -> None:
        """Mark where the end-effector was at instants, and what happened there."""
        joints, _ = motion.trajectory.sample(np.array(instants))
        places = arm_of(self._robot).positions(joints)
        labels = [str(happened) for happened in what]
        self._log(("world", name), rr.Points3D(places, labels=labels, radii=0.01))

    def _move_robot(
        self, instants: Sequence[Any], tool: Tool, recording: Recording
    ) -> None:
        """Write the motion of the links, and of the tool's."""
        frames = link_frames(self._robot, tool, recording.arm, recording.fingers)
        for name, (rotations, positions) in frames.items():
            quaternions = Rotation.from_matrix(rotations).as_quat()
            self._move((*_ROBOT, name), instants, positions, quaternions)

    def _move_scene(self, instants: Sequence[Any], states: State) -> None:
        """Write the motion of the free bodies."""
        softs = {soft.name: soft for soft in self._scene.softs}
        for k, name in enumerate(states.names):
            if name in softs:
                self._deform(softs[name], instants, states.nodes(name))
            else:
                w_last = np.roll(states.quaternions[:, k], -1, axis=-1)
                self._move((*_SCENE, name), instants, states.positions[:, k], w_last)

    def _move(
        self,
        path: _Place,
        instants: Sequence[Any],
        positions: Array,
        quaternions: Array,
    ) -> None:
        """Write the poses of something over time.

        Args:
            path: what moves.
            instants: on both timelines, T each.
            positions: (T, 3), metres.
            quaternions: (T, 4), x, y, z, w.
        """
        poses = rr.Transform3D.columns(translation=positions, quaternion=quaternions)
        self._log_rows(path, instants, poses)

    def _deform(self, soft: Soft, instants: Sequence[Any], nodes: Array) -> None:
        """Write a soft body's surface over time.

        Args:
            soft: the body.
            instants: on both timelines, T each.
            nodes: where its nodes are (T, N, 3), metres.
        """
        skins = np.stack([soft.form.surface(places).vertices for places in nodes])
        vertices = rr.Mesh3D.columns(vertex_positions=skins.reshape(-1, 3))
        lengths = [skins.shape[1]] * len(skins)
        self._log_rows((*_SCENE, soft.name), instants, vertices.partition(lengths))

    def _reward_over_time(self, start: State, states: State) -> Array:
        """Return what each state (T,) would earn."""
        scene = self._scene
        starts = State.stack([start] * len(states.positions))
        first = scene.complete(starts)
        return reward_of(self.task, first, scene.complete(states), None)

    def _set_time(self, generation: int) -> None:
        """Set the time of what is logged next."""
        self._stream.set_time("sim_time", duration=self._clock)
        self._stream.set_time("generation", sequence=generation)

    def _log(self, path: _Place, *what: rr.AsComponents, static: bool = False) -> None:
        """Log at the time that is set, or with ``static`` for all times."""
        self._stream.log(list(path), *what, static=static, strict=True)

    def _log_rows(self, path: _Place, instants: Sequence[Any], columns: Any) -> None:
        """Log many rows at once, at their instants (T,) on both timelines."""
        entity = rr.new_entity_path(list(path))
        self._stream.send_columns(entity, instants, columns, strict=True)

    def _flush(self) -> None:
        """Wait until all data have arrived."""
        self._stream.flush(timeout_sec=_FLUSH_S)


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
    (outcome,) = run.simulator.rollout(run.task, [job])
    if outcome.recording is None:
        raise ValueError(outcome.error or "no recording came back")

    if job.reactions is not None:
        motion = job.reactions.motion  # as it was played

    return motion, outcome, outcome.recording
