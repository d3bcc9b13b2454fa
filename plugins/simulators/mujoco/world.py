"""Compile a scene with a tool, and play jobs in it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import Guards, JointTrajectory, Outcome, Robot, Rollout
from core.robot.description import assembled, joint_name
from core.scene import Scene, Soft, State
from core.simulation.playback import Schedule, begin_guards
from plugins.simulators.inertia import Inertia, inertia_of
from plugins.simulators.mujoco import contacts
from plugins.simulators.mujoco.contacts import Collider, Role, Surface
from plugins.simulators.mujoco.engine import mujoco, rollout, warnings_caught
from plugins.simulators.mujoco.forces import Feeler, Measured, Meter, add_feeler
from plugins.simulators.mujoco.moving import Moving, add_bodies
from plugins.simulators.mujoco.robot import add_servos, load, set_gains
from plugins.simulators.mujoco.shapes import Element, add_geom
from plugins.simulators.mujoco.softs import add_softs, hull_boxes
from plugins.simulators.rolling import rollers

GRAVITY = 9.81
MAX_TIME_STEP = 0.005  # s; above, contacts get soft
CCD_TOLERANCE = 1e-10  # m, of what is searched for a contact: at MuJoCo's own, 1e-6, lying cylinders roll by themselves
_READINGS = 8  # of what the arm feels, in steps that are taken at once
HELD = 1e3  # N m or N, of dry friction that holds a joint of the tool
_STATE = (
    mujoco.mjtState.mjSTATE_FULLPHYSICS
)  # time, joints' positions, their speeds: nothing of ours has more


def inertias_of(scene: Scene) -> dict[str, Inertia]:
    """Compute the inertias of the free rigid bodies, by name."""
    return {
        body.name: inertia_of(body) for body in scene.free if not isinstance(body, Soft)
    }


def compiled(
    robot: Robot,
    scene: Scene,
    inertias: dict[str, Inertia],
    tool: Tool,
    time_step: float,
    tracking_rate: float,
    slip_rate: float,
) -> Element:
    """Compile the model: the arm's joints first, then those of the free bodies.

    Bodies that hang from moving ones gain energy in proportion to the time step, so theirs is half as long. Cloths
    and soft solids are as good at twice the step, for half the time; ropes that fall would pass through things.
    """
    if scene.softs and all(soft.form.kind != "rope" for soft in scene.softs):
        time_step = min(2 * time_step, MAX_TIME_STEP)
    if any(
        joint.parent is not None and not scene[joint.parent].fixed
        for joint in scene.joints
    ):
        time_step /= 2
    spec = described(robot, scene, inertias, tool, time_step, slip_rate)
    if any(rollers(body) for body in scene.bodies):
        spec.option.ccd_tolerance = CCD_TOLERANCE
    add_feeler(
        spec, assembled(robot, tool, fused=True).named[robot.arm_joints[-1]].child
    )
    if (
        len(scene.free) <= 1 and not scene.softs
    ):  # equal but for rounding, up to a tenth faster; not measured on a GPU
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    model = spec.compile()
    set_gains(model, robot, tracking_rate)
    return model


def described(
    robot: Robot,
    scene: Scene,
    inertias: dict[str, Inertia],
    tool: Tool,
    time_step: float,
    slip_rate: float,
    slots: int = 0,
) -> Element:
    """Make the model's spec, without the servos' gains. For ``slots`` see `load`.

    Fixed bodies are all part of the world's body, for which MuJoCo has a tree of bounding boxes.
    """
    spec, colliders = load(robot, tool, slots)
    surfaces = [
        Surface(body.friction, body.rolling_friction, body.restitution)
        for body in scene.bodies
    ]
    contacts.options(spec, time_step, GRAVITY, bouncing=contacts.bounces(surfaces))
    add_servos(spec, robot, tool)
    add_softs(spec, scene, contacts.tools_friction(colliders))
    bearers = add_bodies(spec, scene, inertias)
    for body, surface in zip(scene.bodies, surfaces, strict=True):
        if isinstance(body, Soft):
            continue
        bearer = bearers[body.name]
        frame = body.pose if body.fixed else None
        for part in body.collisions:
            geom = add_geom(
                spec,
                bearer,
                part.shape,
                part.pose if frame is None else frame @ part.pose,
            )
            colliders.append(
                Collider(
                    geom, body.name, bearer.name, Role.SCENE, surface, not body.fixed
                )
            )
    contacts.set_contacts(spec, colliders, slip_rate, scene.joined)
    if any(soft.form.kind == "cloth" for soft in scene.softs):
        hull_boxes(spec)
    return spec


@dataclass(frozen=True, eq=False)
class Joints:
    """Where the robot's joints are among a model's positions.

    Attributes:
        count: of all of them; the free bodies' positions follow.
        driven: those with a motor: the arm's, and the fingers' of a gripper tool.
        loose: the tool's; joints, speeds and positions have the same numbers.
        springs: their stiffness and dry friction, (2, K).
        arm: how many are the arm's.
        grip: how many are fingers'.
        fingers: how many the robot has.
    """

    count: int
    driven: list[int]
    loose: list[int]
    springs: Array
    arm: int
    grip: int
    fingers: int

    @classmethod
    def of(cls, robot: Robot, tool: Tool, model: Element) -> Joints:
        names = (
            robot.joints(tool.gripper),
            [joint_name(bearer.name) for bearer in tool.bearers],
        )
        driven, loose = (
            [int(model.joint(name).qposadr[0]) for name in joints] for joints in names
        )
        springs = (
            np.array(
                [(one.joint.stiffness, one.joint.friction) for one in tool.bearers]
            )
            .reshape(-1, 2)
            .T
        )
        arm = len(robot.arm_joints)
        return cls(
            len(driven) + len(loose),
            driven,
            loose,
            springs,
            arm,
            len(driven) - arm,
            len(robot.finger_joints),
        )

    def hold(self, model: Element, *, held: bool) -> None:
        """Hold the tool's joints, or let them go: held, they have no springs, and their friction bears everything."""
        model.jnt_stiffness[self.loose], model.dof_frictionloss[self.loose] = (
            (0.0, HELD) if held else self.springs
        )

    def read(self, qpos: Array) -> tuple[Array, Array]:
        """Take the arm's joints (T, J), and the fingers' with the tool's (T, F + K), from positions (T, Q)."""
        others = np.zeros((len(qpos), self.fingers + len(self.loose)))
        others[:, : self.grip] = qpos[:, self.driven[self.arm :]]
        others[:, self.fingers :] = qpos[:, self.loose]
        return qpos[:, self.driven[: self.arm]], others


@dataclass(frozen=True, eq=False)
class _Settled:
    """A world after S steps that held joints (J,): states (S + 1, X), all data at the end, and forces if measured."""

    joints: Array
    states: Array
    data: Element
    measured: list[Measured]


class World:
    """Play jobs one after another, each from a copy of the settled world, so that no motion affects the next."""

    def __init__(self, robot: Robot, scene: Scene, tool: Tool, model: Element) -> None:
        self._scene = scene
        self._model = model
        self._joints = Joints.of(robot, tool, model)
        self._moving = Moving(scene, model)
        self._data = mujoco.MjData(model)
        self._feeler = Feeler(model)
        self._settled: _Settled | None = None

    def play(self, job: Rollout) -> Outcome:
        """Play a rollout as `core.simulation.playback.play` does, with all controls given at once."""
        schedule = Schedule(begin_guards(job), self._model.opt.timestep)
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
        outcome = schedule.conclude(start, end, lag, film)
        if meter is None or outcome.recording is None:
            return outcome
        return replace(outcome, recording=meter.measured(outcome.recording, samples))

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
        settle = schedule.settle
        controls = self._controls(schedule)
        joints = np.append(
            trajectory.arm[0], [trajectory.fingers[0]] * self._joints.grip
        )
        settled = self._settle(joints, controls[:settle], meter)
        mujoco.mj_copyData(
            self._data, self._model, settled.data
        )  # which bodies sleep is not part of a state
        if meter:
            meter.begin(settled.measured)
        states = settled.states
        if self._moving.launches:
            states = states.copy()
            self._moving.launch(*self._split(states[-1]))
        self._joints.hold(self._model, held=False)
        if schedule.job.guards is not None:
            return self._felt(schedule, schedule.job.guards, states, meter)
        played = self._steps(self._data, states, controls[settle:], meter)
        return schedule, self._split(played)

    def _felt(
        self, schedule: Schedule, guards: Guards, states: Array, meter: Meter | None
    ) -> tuple[Schedule, tuple[Array, Array]]:
        """Do the steps after the settling as `_run` does, some readings at once; where a guard ends, go back to it."""
        data = self._data
        kept = mujoco.MjData(self._model)
        controls = self._controls(schedule)
        tick = schedule.tick
        done = schedule.settle
        found = [states]
        while done < len(controls):
            last = found[-1][-1:]
            quiet = int(np.searchsorted(schedule.ends[done:], guards.since))
            due = (quiet // tick + 1) * tick  # the steps up to the next reading
            orders = controls[done : done + due + (0 if meter else _READINGS * tick)]
            mujoco.mj_copyData(kept, self._model, data)
            sensed = np.empty((len(orders), self._model.nsensordata))
            with self._feeler.on():
                played = self._steps(data, last, orders, meter, sensed)[1:]
            for end in range(due, len(played) + 1, tick):
                now = float(schedule.ends[done + end - 1])
                if now < guards.since:
                    continue
                arm, _ = self._joints.read(self._split(played[end - 1 : end])[0])
                changed = guards.feel(
                    now, arm[0], *self._feeler.pushes(sensed[end - tick : end])
                )
                if changed is None:
                    continue
                if end < len(played):
                    mujoco.mj_copyData(data, self._model, kept)
                    played = self._steps(data, last, orders[:end], None)[1:]
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
        """Settle with ``controls`` (S, 2 J) that hold joints (J,); kept, since many motions begin the same way."""
        known = self._settled
        count = len(controls)
        if (
            known is None
            or len(known.states) != 1 + count
            or (
                meter is not None and sum(one.length for one in known.measured) != count
            )
            or not np.array_equal(known.joints, joints)
        ):
            data = mujoco.MjData(self._model)
            data.qpos[self._joints.driven] = joints
            start = np.empty((1, mujoco.mj_stateSize(self._model, _STATE)))
            mujoco.mj_getState(self._model, data, start[0], _STATE)
            self._joints.hold(self._model, held=True)
            states = self._steps(data, start, controls, meter)
            known = self._settled = _Settled(
                joints, states, data, [*meter.packed()] if meter else []
            )
        return known

    def _steps(
        self,
        data: Element,
        states: Array,
        controls: Array,
        meter: Meter | None,
        sensed: Array | None = None,
    ) -> Array:
        """Append the state after each step with ``controls`` (S, 2 J) to states (T, X): (T + S, X).

        ``sensed`` (S, Y) is filled with what the model's sensors measure in each.
        """
        if not len(controls):
            return states
        states = np.concatenate([states, np.empty((len(controls), states.shape[1]))])
        now = len(states) - len(controls)
        with warnings_caught() as warnings:
            if self._moving.latches or meter:
                self._one_by_one(data, states[now - 1 :], controls, meter, sensed)
            else:
                rollout(
                    self._model,
                    data,
                    states[now - 1 : now],
                    controls[None],
                    initial_warmstart=data.qacc_warmstart.copy()[None],
                    state=states[None, now:],
                    sensordata=None if sensed is None else sensed[None],
                )
        if (
            data.warning.number.any()
        ):  # the state is not finite, or too large, or there is no more memory
            raise FloatingPointError(
                " ".join(warnings[0].split()) if warnings else "a warning"
            )
        return states

    def _one_by_one(
        self,
        data: Element,
        states: Array,
        controls: Array,
        meter: Meter | None,
        sensed: Array | None,
    ) -> None:
        """Fill in the states (S + 1, X) after the first, and ``sensed``, as MuJoCo's rollout does."""
        model = self._model
        mujoco.mj_setState(model, data, states[0], _STATE)
        for number, (after, control) in enumerate(
            zip(states[1:], controls, strict=True)
        ):
            data.ctrl[:] = control
            self._moving.pull(model, data)
            mujoco.mj_step(model, data)
            mujoco.mj_getState(model, data, after, _STATE)
            if meter:
                meter.measure(data)
            if sensed is not None:
                sensed[number] = data.sensordata

    def _controls(self, schedule: Schedule) -> Array:
        """Make the controls (S, 2 J): each joint's target position and speed, and then each drive's."""
        times = schedule.times
        arm, fingers, speeds, finger_speeds = schedule.targets()
        aims = self._moving.aim(np.append(times, schedule.ends[-1:]))
        drives = aims[1:]
        if self._model.opt.integrator != mujoco.mjtIntegrator.mjINT_DISCRETE:
            # Servos compare them with where joints are when the step begins.
            arm, fingers = schedule.job.trajectory.sample(times)
            drives = aims[:-1]
        count = self._joints.arm
        own = len(self._joints.driven)
        controls = np.empty((len(times), own + self._moving.drives, 2))
        controls[:, :count, 0] = arm
        controls[:, :count, 1] = speeds
        controls[:, count:own, 0] = fingers[:, None]
        controls[:, count:own, 1] = finger_speeds[:, None]
        controls[:, own:, 0] = drives
        controls[:, own:, 1] = np.diff(aims, axis=0) / schedule.time_step
        return controls.reshape(len(times), -1)

    def stepped(self, start: JointTrajectory) -> Stepped:
        """Make the same world for stepping from outside, with the robot at the trajectory's first targets."""
        return Stepped(self._model, self._moving, start, self._joints)


class Stepped:
    """A `core.interfaces.World`."""

    def __init__(
        self, model: Element, moving: Moving, start: JointTrajectory, joints: Joints
    ) -> None:
        self.time_step = float(model.opt.timestep)
        self._model = model
        self._data = mujoco.MjData(model)
        self._joints = joints
        self._moving = moving
        self._begun = -np.inf  # steps since the launch
        self._data.qpos[joints.driven] = [
            *start.arm[0],
            *([start.fingers[0]] * joints.grip),
        ]
        self._ahead = model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE

    def step(
        self, arm: Array, fingers: float, speeds: Array, finger_speed: float
    ) -> None:
        back = 0.0 if self._ahead else self.time_step  # see `World._controls`
        controls = self._data.ctrl.reshape(-1, 2)
        count = self._joints.arm
        own = len(self._joints.driven)
        controls[:count, 0] = arm - back * speeds
        controls[:count, 1] = speeds
        controls[count:own] = fingers - back * finger_speed, finger_speed
        if self._moving.drives:
            begin, end = self._moving.aim(
                (self._begun + np.array([0.0, 1.0])) * self.time_step
            )
            controls[own:, 0] = end if self._ahead else begin
            controls[own:, 1] = (end - begin) / self.time_step
        self._moving.pull(self._model, self._data)
        self._joints.hold(self._model, held=self._begun < 0)
        self._begun += 1
        with warnings_caught():  # a world that diverges shows it in its state too
            mujoco.mj_step(self._model, self._data)

    def launch(self) -> None:
        self._begun = 0.0
        self._moving.launch(self._data.qpos, self._data.qvel)

    def joints(self) -> tuple[Array, Array]:
        arm, others = self._joints.read(self._data.qpos[None])
        return arm[0], others[0]

    def state(self) -> State:
        return self._moving.state(self._data.qpos, self._data.qvel)
