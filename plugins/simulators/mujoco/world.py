"""Step a compiled world: all steps of a block in one call, where nothing of ours is in between."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, NamedTuple

import numpy as np

from core import interfaces
from core.design import Tool
from core.geometry import Array
from core.interfaces import Block, Order, Passed, Pushes, Reading, Robot, Rollout
from core.scene import Scene, State
from core.values.grips import Gripped
from core.values.jobs import FEEL_S
from plugins.simulators.mujoco.arm import Joints
from plugins.simulators.mujoco.bodies import Moving
from plugins.simulators.mujoco.bonds import Bonds
from plugins.simulators.mujoco.contacts import is_discrete
from plugins.simulators.mujoco.engine import mujoco, rollout, warnings_caught
from plugins.simulators.mujoco.forces import Feeler, Meter
from plugins.simulators.mujoco.grips import Grips
from plugins.simulators.mujoco.motors import Motors
from plugins.simulators.mujoco.shapes import Element

# Time, the joints' positions, and their speeds: nothing of ours has more.
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


_Note = tuple[int, Array]
"""A snapshot: how many steps the job has done, and the state after them (X,)."""


class _Saved(NamedTuple):
    """A world as it was after a step.

    Attributes:
        data: MuJoCo's.
        done: how many steps of the job were done.
        moved: how many of them since the launch.
        contacts: what was measured, see `Meter.save`.
        bonds: see `Bonds.save`.
        grips: see `Grips.save`; None: the tool has none.
    """

    data: Element
    done: int
    moved: float
    contacts: Any
    bonds: Any
    grips: Any


class World(interfaces.World):
    """A world that jobs are played in one after another; `begin` comes before each of them.

    MuJoCo steps a whole block in one call, for which all controls are made before; it steps singly where latches pull
    or forces are measured.

    Args:
        robot: the arm.
        scene: in the layout that is played.
        tool: what the arm holds.
        model: compiled of these, see `compile_model`.
    """

    def __init__(self, robot: Robot, scene: Scene, tool: Tool, model: Element) -> None:
        self.time_step = float(model.opt.timestep)
        self._robot = robot
        self._tool = tool
        self._scene = scene
        self._model = model
        self._joints = Joints(robot, tool, model)
        self._moving = Moving(scene, model)
        self._data = mujoco.MjData(model)
        self._feeler = Feeler(model)
        self._motors = Motors(model, self._joints.arm)
        self._tick = max(1, round(FEEL_S / self.time_step))
        # The discrete integrator takes a servo's force at the step's end, so servos get the target there. With the
        # other one the force is that at the step's beginning.
        discrete = is_discrete(model.opt)
        self._targeted = slice(1, None) if discrete else slice(None, -1)

    @property
    def rewinds(self) -> bool:  # type: ignore[override]
        # Else all that was measured is copied each time.
        return self._meter is None and self._grips is None and not self._scene.bonds

    def begin(self, job: Rollout) -> None:
        """Begin anew, with the robot at the first targets of a job's motion, and the tool's joints held."""
        trajectory = job.trajectory

        self._meter: Meter | None = None
        if job.forces and job.record_hz > 0:
            self._meter = Meter(self._scene, self._model)

        self._bonds = Bonds(self._scene, self._model, self._data)
        self._grips: Grips | None = None
        if self._tool.gripping:
            self._grips = Grips(
                self._robot, self._tool, self._scene, self._model, self._data
            )
        self._done = 0
        self._moved = -np.inf  # steps since the launch
        mujoco.mj_resetData(self._model, self._data)
        driven = self._joints.driven
        self._data.qpos[driven] = trajectory.fingers[0]
        self._data.qpos[driven[: self._joints.arm]] = trajectory.arm[0]
        self._joints.hold(self._model, held=True)

    def step(self, order: Order) -> None:
        back = np.array([self.time_step, 0.0])
        speeds = np.array([order.speeds])
        steps = self._moved + np.array([0.0, 1.0])
        control = self._controls(
            np.asarray(order.arm) - back[:, None] * speeds,
            order.fingers - back * order.finger_speed,
            speeds,
            np.array([order.finger_speed]),
            steps * self.time_step,
        )
        self._done += 1
        self._moved += 1
        with warnings_caught():  # a world that diverges shows it in its state too
            fingers = np.array([order.fingers])
            self._step_singly(self._read_state()[None], control, fingers, None)

    def joints(self) -> tuple[Array, Array]:
        """Return the arm's joints (A,), and the fingers' with the tool's (F + K,)."""
        arm, others = self._joints.read(self._data.qpos[None])
        return arm[0], others[0]

    def state(self) -> State:
        """Return the state of the scene's bodies."""
        return self._moving.state(self._data.qpos, self._data.qvel)

    def launch(self) -> None:
        """Begin the motion: launched bodies get their velocities, and drives and the tool's joints begin to move."""
        self._moved = 0.0
        self._moving.launch(self._data.qpos, self._data.qvel)
        self._joints.hold(self._model, held=False)
        if self._grips is not None:
            self._grips.launch()

    def advance(self, block: Block) -> Passed:
        """Take the steps of a block.

        Raises:
            mujoco.FatalError: MuJoCo refuses to go on.
            FloatingPointError: the world diverged.
        """
        if not block.readings:
            states = self._run(block)
            torques = self._find_torques(block, states)
            return Passed(self._take_notes(block, states), torques=torques)

        sensed = np.empty((len(block), self._model.nsensordata))
        with self._feeler.on():
            states = self._run(block, sensed)

        torques = self._find_torques(block, states)
        qpos, _ = self._split(states[1:])
        readings = []
        for end in block.readings:
            arm, _ = self._joints.read(qpos[end - 1 : end])
            pushes = self._feeler.pushes(sensed[end - self._tick : end])
            readings.append(Reading(arm[0], *pushes))

        return Passed(self._take_notes(block, states), readings, torques)

    def save(self) -> _Saved:
        return _Saved(
            copy(self._data),
            self._done,
            self._moved,
            self._meter and self._meter.save(),
            self._bonds.save(),
            self._grips and self._grips.save(),
        )

    def restore(self, saved: _Saved) -> None:
        mujoco.mj_copyData(self._data, self._model, saved.data)
        self._done = saved.done
        self._moved = saved.moved
        if self._meter is not None:
            self._meter.restore(saved.contacts)
        self._bonds.restore(saved.bonds)
        if self._grips is not None:
            self._grips.restore(saved.grips)
        self._joints.hold(self._model, held=False)

    def note(self) -> _Note:
        return self._done, self._read_state()

    def read(self, notes: Sequence[_Note]) -> tuple[Array, Array, State]:
        qpos, qvel = self._split(np.array([state for _, state in notes]))
        return *self._joints.read(qpos), self._moving.state(qpos, qvel)

    def contact_forces(
        self, notes: Sequence[_Note], instants: Array
    ) -> tuple[Mapping[tuple[str, str], Array], Pushes | None]:
        assert self._meter is not None
        return self._meter.mean_forces(np.array([done for done, _ in notes]))

    def loads(self, notes: Sequence[_Note]) -> Mapping[str, Array]:
        return self._bonds.loads([done for done, _ in notes])

    def grips(self) -> tuple[Gripped, ...]:
        return () if self._grips is None else self._grips.report()

    def _find_torques(self, block: Block, states: Array) -> Array | None:
        """Find the greatest torque of each of the arm's motors at a block's measures (J,); None: it has none.

        Args:
            block: that was played.
            states: before the first step, and after each (S + 1, X).
        """
        if not block.measures:
            return None

        qpos, qvel = self._split(states)
        targets = block.arm[self._targeted]
        steps = np.array(block.measures)
        torques = self._motors.compute(qpos, qvel, targets, block.speeds, steps)
        greatest: Array = np.abs(torques).max(axis=0)
        return greatest

    def _take_notes(self, block: Block, states: Array) -> list[_Note]:
        """Make the notes of a block that has just been played, with the states before and after its steps."""
        self._done = block.end
        self._moved += len(block)
        return [(block.begin + mark, states[mark]) for mark in block.marks]

    def _read_state(self) -> Array:
        """Read MuJoCo's state (X,)."""
        state = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        mujoco.mj_getState(
            self._model,
            self._data,
            state,
            _STATE,
        )
        return state

    def _split(self, states: Array) -> tuple[Array, Array]:
        """Split states (..., X) into positions (..., Q) and speeds (..., V)."""
        speeds = 1 + self._model.nq
        ends = [1, speeds, speeds + self._model.nv]
        _, qpos, qvel, _ = np.split(states, ends, axis=-1)
        return qpos, qvel

    def _run(self, block: Block, sensed: Array | None = None) -> Array:
        """Take the steps of a block, and return the states before the first, and after each (S + 1, X).

        Args:
            block: says the targets.
            sensed: is filled with what the model's sensors measure in each step (S, Y), if given.

        Raises:
            FloatingPointError: the world diverged.
        """
        data = self._data
        first = self._read_state()
        states = np.empty((len(block) + 1, len(first)))
        states[0] = first
        if not len(block):
            return states

        controls = self._controls(
            block.arm,
            block.fingers,
            block.speeds,
            block.finger_speeds,
            block.instants,
        )
        with warnings_caught() as warnings:
            stepped = self._meter or self._grips or self._scene.bonds
            if self._moving.latched or stepped:
                self._step_singly(states[1:], controls, block.fingers[1:], sensed)
            else:
                rollout(
                    self._model,
                    data,
                    first[None],
                    controls[None],
                    initial_warmstart=data.qacc_warmstart.copy()[None],
                    state=states[None, 1:],
                    sensordata=None if sensed is None else sensed[None],
                )

        # The state is not finite, or too large, or there is no more memory.
        if data.warning.number.any():
            cause = next(iter(warnings), "a warning")
            raise FloatingPointError(" ".join(cause.split()))

        return states

    def _step_singly(
        self, states: Array, controls: Array, fingers: Array, sensed: Array | None
    ) -> None:
        """Fill in the states (S, X) and ``sensed``, as MuJoCo's rollout does.

        The latches' forces are set before each step, and contacts measured after it.
        """
        model = self._model
        data = self._data
        for number, control in enumerate(controls):
            data.ctrl[:] = control
            self._moving.pull(model, data)
            mujoco.mj_step(model, data)
            mujoco.mj_getState(
                model,
                data,
                states[number],
                _STATE,
            )
            self._bonds.end_step()
            if self._grips is not None:
                self._grips.end_step(self, float(fingers[number]))
            if self._meter is not None:
                self._meter.measure(data)
            if sensed is not None:
                sensed[number] = data.sensordata

    def _controls(
        self,
        arm: Array,
        fingers: Array,
        speeds: Array,
        finger_speeds: Array,
        instants: Array,
    ) -> Array:
        """Make the controls (S, 2 J): each joint's target position and speed, and then each drive's.

        Args:
            arm: its targets when steps begin, and when the last one ends (S + 1, A).
            fingers: theirs (S + 1,).
            speeds: of the arm's targets (S, A).
            finger_speeds: of the fingers' (S,).
            instants: of the motion, of which the drives' targets are (S + 1,), seconds.
        """
        aims = self._moving.aim(instants)
        at = self._targeted
        driven = len(self._joints.driven)
        controls = np.empty((len(speeds), driven + len(self._moving.drives), 2))
        count = self._joints.arm
        controls[:, :count, 0] = arm[at]
        controls[:, :count, 1] = speeds
        controls[:, count:driven, 0] = fingers[at, None]
        controls[:, count:driven, 1] = finger_speeds[:, None]
        controls[:, driven:, 0] = aims[at]
        controls[:, driven:, 1] = np.diff(aims, axis=0) / self.time_step
        return controls.reshape(len(controls), -1)
