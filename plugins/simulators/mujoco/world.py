"""Play jobs in a compiled world, with all controls of a motion given at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import Guards, JointTrajectory, Outcome, Robot, Rollout
from core.scene import Scene
from core.simulation.playback import Schedule, begin_guards, refuse_targets
from plugins.simulators.mujoco.contacts import is_discrete
from plugins.simulators.mujoco.engine import mujoco, rollout, warnings_caught
from plugins.simulators.mujoco.forces import Feeler, Measured, Meter
from plugins.simulators.mujoco.joints import Joints
from plugins.simulators.mujoco.moving import Moving
from plugins.simulators.mujoco.shapes import Element
from plugins.simulators.mujoco.stepped import Stepped

_READINGS = 8  # of what the arm feels, in steps that are taken at once
# Time, the joints' positions, and their speeds: nothing of ours has more.
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True, eq=False)
class _Settled:
    """A world after S steps that held joints (J,).

    Attributes:
        joints: the positions that were held (J,).
        states: before the first step, and after each (S + 1, X).
        data: all of MuJoCo's at the end.
        measured: the contacts, if they were measured.
    """

    joints: Array
    states: Array
    data: Element
    measured: list[Measured]

    def serves(self, joints: Array, count: int, *, measured: bool) -> bool:
        """Check if it is what comes of so many steps with these joints (J,), ``measured`` or not."""
        if len(self.states) != 1 + count or not np.array_equal(self.joints, joints):
            return False

        return not measured or sum(part.length for part in self.measured) == count


class World:
    """Play jobs one after another, each from a copy of the settled world, so that no motion affects the next.

    MuJoCo steps a whole motion in one call, for which all controls are made before. It stops on the way only where a
    guard may end, and steps singly where latches pull or forces are measured.

    Args:
        robot: the arm.
        scene: in the layout that is played.
        tool: what the arm holds.
        model: compiled of these, see `compile_model`.
    """

    def __init__(self, robot: Robot, scene: Scene, tool: Tool, model: Element) -> None:
        self._scene = scene
        self._model = model
        self._joints = Joints.find(robot, tool, model)
        self._moving = Moving(scene, model)
        self._data = mujoco.MjData(model)
        self._feeler = Feeler(model)
        self._settled: _Settled | None = None

    def play(self, job: Rollout) -> Outcome:
        """Play a rollout as `core.simulation.playback.play` does, with all controls given at once.

        A world that diverges, or that MuJoCo refuses, gives an outcome with an error.
        """
        job = begin_guards(job)
        refused = refuse_targets(job)
        if refused is not None:
            return refused

        schedule = Schedule(job, self._model.opt.timestep)
        meter = None
        if schedule.every and job.forces:
            meter = Meter(self._scene, self._model)

        try:
            schedule, (qpos, qvel) = self._run(schedule, meter)
        except (mujoco.FatalError, FloatingPointError) as error:
            return Outcome(None, None, error=f"MuJoCo: {error}")

        lag = schedule.measure_lag(self._joints.read(qpos[schedule.looks + 1])[0])
        start = self._moving.state(qpos[schedule.settle], qvel[schedule.settle])
        end = self._moving.state(qpos[-1], qvel[-1])
        if not schedule.every:
            return schedule.conclude(start, end, lag)

        samples = schedule.samples
        states = self._moving.state(qpos[samples], qvel[samples])
        film = (*self._joints.read(qpos[samples]), states)
        outcome = schedule.conclude(
            start,
            end,
            lag,
            film,
        )
        if meter is None or outcome.recording is None:
            return outcome

        return replace(outcome, recording=meter.add_to(outcome.recording, samples))

    def stepped(self, start: JointTrajectory) -> Stepped:
        """Make the same world for stepping from outside, with the robot at the trajectory's first targets."""
        return Stepped(
            self._model,
            self._moving,
            start,
            self._joints,
        )

    def _run(
        self, schedule: Schedule, meter: Meter | None
    ) -> tuple[Schedule, tuple[Array, Array]]:
        """Step the world: joint positions (S + 1, Q) and speeds (S + 1, V) before each step, and after the last.

        Guards may change the trajectory and with it the schedule: it comes back as it was played. While the world
        settles, the joints are held where the motion begins. ``meter`` measures the forces in each step.

        Raises:
            mujoco.FatalError: MuJoCo refuses to go on.
            FloatingPointError: the world diverged.
        """
        trajectory = schedule.job.trajectory
        fingers = [trajectory.fingers[0]] * self._joints.grip
        joints = np.append(trajectory.arm[0], fingers)
        controls = self._controls(schedule)
        settled = self._settle(joints, controls[: schedule.settle], meter)
        # All data is copied, since a state does not say which bodies sleep.
        mujoco.mj_copyData(self._data, self._model, settled.data)
        if meter is not None:
            meter.begin(settled.measured)

        states = settled.states

        if self._moving.launched:
            states = states.copy()
            self._moving.launch(*self._split(states[-1]))

        self._joints.hold(self._model, held=False)

        guards = schedule.job.guards
        if guards is not None:
            return self._run_guarded(
                schedule,
                guards,
                controls,
                states,
                meter,
            )

        played = self._steps(
            self._data,
            states,
            controls[schedule.settle :],
            meter,
        )
        return schedule, self._split(played)

    def _run_guarded(
        self,
        schedule: Schedule,
        guards: Guards,
        controls: Array,
        states: Array,
        meter: Meter | None,
    ) -> tuple[Schedule, tuple[Array, Array]]:
        """Do the steps after the settling as `_run` does, where a guard may change the motion.

        Several readings are played in one call, which is faster. Where a guard ends at one of them, the world goes back
        to where the call began, and is played up to that reading alone.
        """
        data = self._data
        kept = mujoco.MjData(self._model)
        tick = schedule.tick
        done = schedule.settle
        found = [states]

        while done < len(controls):
            last = found[-1][-1:]
            quiet = int(np.searchsorted(schedule.ends[done:], guards.since))
            due = (quiet // tick + 1) * tick  # the steps up to the next reading
            count = due
            if meter is None:  # what it has measured can't be taken back
                count += _READINGS * tick

            orders = controls[done : done + count]

            mujoco.mj_copyData(kept, self._model, data)
            sensed = np.empty((len(orders), self._model.nsensordata))
            with self._feeler.on():
                played = self._steps(
                    data,
                    last,
                    orders,
                    meter,
                    sensed,
                )[1:]

            for end in range(due, len(played) + 1, tick):
                now = float(schedule.ends[done + end - 1])
                if now < guards.since:
                    continue

                qpos, _ = self._split(played[end - 1 : end])
                arm, _ = self._joints.read(qpos)
                points, forces = self._feeler.pushes(sensed[end - tick : end])
                changed = guards.feel(
                    now,
                    arm[0],
                    points,
                    forces,
                )
                if changed is None:
                    continue

                if end < len(played):
                    mujoco.mj_copyData(data, self._model, kept)
                    played = self._steps(
                        data,
                        last,
                        orders[:end],
                        None,
                    )[1:]

                job = replace(schedule.job, trajectory=changed)
                schedule = Schedule(job, schedule.time_step)
                controls = self._controls(schedule)
                break

            found.append(played)
            done += len(played)

        return schedule, self._split(np.concatenate(found))

    def _split(self, states: Array) -> tuple[Array, Array]:
        """Split states (..., X) into positions (..., Q) and speeds (..., V)."""
        _, qpos, qvel = np.split(states, [1, 1 + self._model.nq], axis=-1)
        return qpos, qvel

    def _settle(self, joints: Array, controls: Array, meter: Meter | None) -> _Settled:
        """Let the world settle; kept, since many motions begin the same way.

        Args:
            joints: positions (J,) of those with a motor.
            controls: of each step (S, 2 J), which hold them there.
            meter: measures the forces in each step, if given.
        """
        known = self._settled
        measured = meter is not None
        if known is not None and known.serves(joints, len(controls), measured=measured):
            return known

        data = mujoco.MjData(self._model)
        data.qpos[self._joints.driven] = joints
        start = np.empty((1, mujoco.mj_stateSize(self._model, _STATE)))
        mujoco.mj_getState(
            self._model,
            data,
            start[0],
            _STATE,
        )
        self._joints.hold(self._model, held=True)
        states = self._steps(
            data,
            start,
            controls,
            meter,
        )
        contacts = []
        if meter is not None:
            contacts = [*meter.pack()]

        self._settled = _Settled(
            joints,
            states,
            data,
            contacts,
        )
        return self._settled

    def _steps(
        self,
        data: Element,
        states: Array,
        controls: Array,
        meter: Meter | None,
        sensed: Array | None = None,
    ) -> Array:
        """Append the state after each step to states (T, X): (T + S, X).

        Args:
            data: MuJoCo's, as it is after the last of the states; it is stepped.
            states: those so far (T, X).
            controls: of each step (S, 2 J).
            meter: measures the forces in each step, if given.
            sensed: is filled with what the model's sensors measure in each step (S, Y), if given.

        Raises:
            FloatingPointError: the world diverged.
        """
        if not len(controls):
            return states

        now = len(states)
        states = np.concatenate([states, np.empty((len(controls), states.shape[1]))])
        with warnings_caught() as warnings:
            if self._moving.latched or meter is not None:
                self._step_singly(
                    data,
                    states[now - 1 :],
                    controls,
                    meter,
                    sensed,
                )
            else:
                sensordata = None
                if sensed is not None:
                    sensordata = sensed[None]

                rollout(
                    self._model,
                    data,
                    states[now - 1 : now],
                    controls[None],
                    initial_warmstart=data.qacc_warmstart.copy()[None],
                    state=states[None, now:],
                    sensordata=sensordata,
                )

        # The state is not finite, or too large, or there is no more memory.
        if data.warning.number.any():
            first = next(iter(warnings), "a warning")
            raise FloatingPointError(" ".join(first.split()))

        return states

    def _step_singly(
        self,
        data: Element,
        states: Array,
        controls: Array,
        meter: Meter | None,
        sensed: Array | None,
    ) -> None:
        """Fill in the states (S + 1, X) after the first, and ``sensed``, as MuJoCo's rollout does.

        The latches' forces are set before each step, and contacts measured after it.
        """
        model = self._model
        mujoco.mj_setState(
            model,
            data,
            states[0],
            _STATE,
        )
        for number, control in enumerate(controls):
            data.ctrl[:] = control
            self._moving.pull(model, data)
            mujoco.mj_step(model, data)
            mujoco.mj_getState(
                model,
                data,
                states[number + 1],
                _STATE,
            )
            if meter is not None:
                meter.measure(data)
            if sensed is not None:
                sensed[number] = data.sensordata

    def _controls(self, schedule: Schedule) -> Array:
        """Make the controls (S, 2 J): each joint's target position and speed, and then each drive's.

        The discrete integrator takes a servo's force at the step's end, so it gets the target there. With the other
        one the force is that at the step's beginning.
        """
        times = schedule.times
        arm, fingers, speeds, finger_speeds = schedule.targets()
        aims = self._moving.aim(np.append(times, schedule.ends[-1:]))
        drives = aims[1:]

        if not is_discrete(self._model.opt):
            # Servos compare them with where joints are when the step begins.
            arm, fingers = schedule.job.trajectory.sample(times)
            drives = aims[:-1]

        driven = len(self._joints.driven)
        controls = np.empty((len(times), driven + len(self._moving.drives), 2))
        self._joints.command(
            controls, arm, speeds, fingers[:, None], finger_speeds[:, None]
        )
        controls[:, driven:, 0] = drives
        controls[:, driven:, 1] = np.diff(aims, axis=0) / schedule.time_step
        return controls.reshape(len(times), -1)
