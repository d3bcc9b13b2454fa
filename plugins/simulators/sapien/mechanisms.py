"""Join a scene's bodies in PhysX, and make joints spring, latch and drive.

The bodies stay bodies of their own. PhysX's D6 joints hold them, and its solver (TGS) closes those within micrometres.
SAPIEN 3.0.3 can't lock the swing of a D6 joint, so hinges and sliders are held at two points of their axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from core.errors import UsageError
from core.geometry import Array, Pose
from core.scene import Drive, Joint, Latch, Scene
from plugins.simulators.forces import latch_force
from plugins.simulators.inertia import Inertia
from plugins.simulators.lifting import Lift
from plugins.simulators.sapien.engine import physx, sapien
from plugins.simulators.sapien.shapes import to_sapien
from plugins.simulators.sapien.surfaces import Apart

# So many times the solver's iterations, as for the arm with a hand: a touch doesn't change how often forces act.
_ITERATIONS = 4
_STICKS = 1e5  # dry friction is a damper that gives up at 1 / _STICKS m/s or rad/s
_GIVES_WAY = 0.001  # m or rad off its target: there a motor does all it can
_LEAST = 1e-9  # N s/m or N m s/rad, of a damper that only carries a force
_MOST = 0.9  # of what a damper is made stronger by
_PAIRS = 32  # bits
_DRIVES = {
    "hinge": "twist",
    "slider": "x",
    "ball": "slerp",
}
_STILL = np.zeros(3)


def apart(scene: Scene) -> dict[str, Apart]:
    """Return for each joined body what it doesn't touch: bodies that a joint connects share a bit.

    Raises:
        UsageError: a mechanism has more joints than there are bits.
    """
    roots: dict[str, str] = {}
    pairs: dict[str, list[tuple[str, str]]] = {}
    for placed in scene.ordered_joints:
        body = placed.joint.body
        parent = placed.joint.parent
        if parent is not None:
            roots[body] = roots.setdefault(parent, parent)
            pairs.setdefault(roots[body], []).append((body, parent))

    found: dict[str, Apart] = {}
    for number, (root, joined) in enumerate(pairs.items(), start=1):
        if len(joined) > _PAIRS:
            raise UsageError(
                f"sim=sapien: {len(joined)} joints lead to the body {root!r}, and it can handle {_PAIRS}; "
                "let some of the bodies hang from the world (parent None), or take another engine"
            )

        for bit, pair in enumerate(joined):
            for name in pair:
                bits = found.get(name, Apart()).bits
                found[name] = Apart(number, bits | 1 << bit)

    return found


class Joints:
    """The joints of a scene whose bodies are at their initial poses.

    Call `act` before each step, and `begin` once, when the robot's motion begins.

    Args:
        scene: the scene.
        inertias: of the free bodies, by name.
        components: PhysX's of the free bodies, by name.
        time_step: seconds.
        tracking_rate: how fast a drive converges to its target, 1/s.
    """

    def __init__(
        self,
        scene: Scene,
        inertias: Mapping[str, Inertia],
        components: Mapping[str, Any],
        time_step: float,
        tracking_rate: float,
    ) -> None:
        self._time_step = time_step
        self._steps = 0
        self._begun = False
        # Each acts before a step that ends at some time.
        self.acting: list[_Pull | _BallPull | _Servo] = []

        for placed in scene.ordered_joints:
            joint = placed.joint
            child = components[joint.body]
            parent = components.get(joint.parent or "")
            child.solver_position_iterations *= _ITERATIONS
            child.sleep_threshold = 0.0  # a door that falls shut slowly does not stop

            inside = scene[joint.body].pose
            if parent is not None and joint.parent is not None:
                inside = scene[joint.parent].pose.inverse() @ inside

            hinge = _Hinge(
                joint,
                child,
                parent,
                inside,
                inertias[joint.body],
            )
            self.acting += _hold(hinge, time_step, tracking_rate)

    def begin(self) -> None:
        """Begin the time of drives."""
        self._begun = True

    def act(self) -> None:
        """Set what changes for the next time step."""
        self._steps += self._begun
        time = self._steps * self._time_step
        for acting in self.acting:
            acting.act(time)


class _Hinge:
    """Where a body hangs from a joint, of any kind.

    A joint's frame has the joint's axis as x, and hinges turn from the middle of their range.

    Attributes:
        joint: the joint.
        child: PhysX's body that it moves.
        middle: of a hinge's range, rad.
        slack: how much easier the body turns about its centre of mass than about the joint, 1/(kg m^2).
        reach: between two points that move independently, m.

    Args:
        joint: the joint.
        child: PhysX's body.
        parent: what it hangs from; None: something fixed, or the world.
        inside: the body's pose in its parent, or in the world.
        inertia: the body's.
    """

    def __init__(
        self, joint: Joint, child: Any, parent: Any, inside: Pose, inertia: Inertia
    ) -> None:
        self.joint = joint
        self.child = child
        self._parent = parent
        self.middle = 0.0
        if joint.kind == "hinge" and joint.limited:
            self.middle = (joint.lower + joint.upper) / 2

        moved = (self.middle - joint.start, 0.0, 0.0)

        origin = np.asarray(joint.origin)
        axis = np.asarray(joint.axis)
        back = Pose.xyz_rpy(_STILL, moved)
        self.slack = 0.0

        if joint.kind == "slider":
            back = Pose.xyz_rpy(moved, _STILL)
        else:
            turns_about = axis if joint.kind == "hinge" else None
            self.slack = _find_slack(inertia, origin, turns_about)

        self.reach = 0.0
        turned = Rotation.identity()
        if joint.kind != "ball":
            turned, _ = Rotation.align_vectors([axis], [[1.0, 0.0, 0.0]])
            origin = origin + axis * ((inertia.frame.position - origin) @ axis)
            self.reach = math.sqrt(float(inertia.moments.max()) / inertia.mass)

        self._in_child = Pose.from_rotation(origin, turned)
        self._in_parent = inside @ self._in_child @ back

    def connect(self, along: float = 0.0) -> Any:
        """Make a D6 joint in which everything moves, its frame so far along the axis, m."""
        component = physx.PhysxDriveComponent(self.child)
        if self._parent is not None:
            component.parent = self._parent

        shift = Pose(np.array([along, 0.0, 0.0]))
        component.pose_in_parent = to_sapien(self._in_parent @ shift)
        component.pose_in_child = to_sapien(self._in_child @ shift)
        self.child.entity.add_component(component)
        return component

    def hold_point(self, along: float) -> Any:
        """Hold a point of the axis, so far along it, on the axis; return the D6 joint that does."""
        component = self.connect(along)
        component.set_limit_y(0.0, 0.0)
        component.set_limit_z(0.0, 0.0)
        return component


def _hold(
    hinge: _Hinge, time_step: float, tracking_rate: float
) -> Iterator[_Pull | _BallPull | _Servo]:
    """Make a joint, and yield what acts in it.

    The first D6 joint holds the body, limits it, and has its spring, damper and latches. Dry friction and a drive act
    in others, since each has one motor.

    Args:
        hinge: where the body hangs.
        time_step: seconds.
        tracking_rate: of drives, 1/s.
    """
    joint = hinge.joint
    main = hinge.hold_point(0.0)
    if joint.kind != "ball":
        hinge.hold_point(hinge.reach)

    limit = main.set_limit_twist

    if joint.kind == "slider":
        main.set_limit_twist(0.0, 0.0)
        limit = main.set_limit_x
    else:
        main.set_limit_x(0.0, 0.0)

    if joint.limited:
        limit(joint.lower - hinge.middle, joint.upper - hinge.middle)

    motor = _Motor(main, hinge, time_step)
    motor.resist(joint.stiffness if joint.kind == "ball" else 0.0, joint.damping)

    if joint.kind == "ball":
        if joint.stiffness:
            yield _BallPull(motor, joint)
    elif joint.latches or (joint.stiffness and joint.kind == "hinge"):
        yield _Pull(motor, joint)
    elif joint.stiffness:
        motor.resist(joint.stiffness, joint.damping)
        motor.aim(joint.rest)

    if joint.friction:
        brake = _Motor(hinge.connect(), hinge, time_step)
        brake.resist(0.0, joint.friction * _STICKS, joint.friction)

    if joint.drive is not None:
        servo = _Motor(hinge.connect(), hinge, time_step)
        yield _Servo(
            servo,
            joint.drive,
            tracking_rate,
            time_step,
        )


def _find_slack(inertia: Inertia, origin: Array, axis: Array | None) -> float:
    """Compute `_Hinge.slack`.

    Args:
        inertia: the body's.
        origin: (3,) of the joint, in the body's frame, metres.
        axis: (3,) that it turns about; None: any.
    """
    arm = inertia.frame.position - origin
    moment = float(inertia.moments.max())
    if axis is not None:
        arm = arm - axis * (arm @ axis)
        along = inertia.frame.rotation.apply(axis, inverse=True)
        moment = float(inertia.moments @ along**2)

    return 1 / moment - 1 / (moment + inertia.mass * float(arm @ arm))


class _Motor:
    """A spring, a damper and a force in a joint, all of which the solver applies in each of its iterations.

    A damper acts once more in the velocity iteration, and a spring damps like stiffness times the time of an iteration.
    Both are taken off the damper. It also carries the force, as the speed that it aims at. And the solver sees a body
    that turns about its centre of mass, so it makes all of it too weak.

    Args:
        component: the D6 joint in which it acts.
        hinge: where that is.
        time_step: seconds.
    """

    def __init__(self, component: Any, hinge: _Hinge, time_step: float) -> None:
        self.component = component
        self._kind = hinge.joint.kind
        self._middle = hinge.middle
        self._set = getattr(component, f"set_drive_property_{_DRIVES[self._kind]}")

        iterations = hinge.child.solver_position_iterations
        self._time_step = time_step
        self._share = iterations / (iterations + 1)
        self._iteration_s = time_step / iterations
        self._damping = _LEAST
        self._slack = hinge.slack * self._iteration_s  # per unit of damping

    def resist(self, stiffness: float, damping: float, limit: float = math.inf) -> None:
        """Set the spring, N/m or N m/rad, the damper, N s/m or N m s/rad, and the most that both do, N or N m."""
        inherent = stiffness * self._iteration_s
        self._damping = max(damping * self._share - inherent, _LEAST)

        scale = 1.0
        if self._kind == "ball" and stiffness > 0:
            scale = 4.0  # then PhysX works with half angles

        scale /= 1 - min(self._slack * (self._damping + inherent), _MOST)
        self._set(scale * stiffness, scale * self._damping, limit * self._time_step)

    def push(self, force: float | Array) -> None:
        """Set the force, N or N m; a ball's is a torque (3,)."""
        speed = force * self._share / self._damping

        match self._kind:
            case "slider":
                self.component.set_drive_velocity_target([speed, 0.0, 0.0], _STILL)
            case "hinge":
                self.component.set_drive_velocity_target(_STILL, [-speed, 0.0, 0.0])
            case _:
                self.component.set_drive_velocity_target(_STILL, speed)

    def aim(self, position: float) -> None:
        """Put the end of the spring of a hinge or slider somewhere, m or rad."""
        away = position - self._middle
        target = sapien.Pose([away, 0.0, 0.0])
        if self._kind != "slider":
            turn = [math.cos(away / 2), math.sin(away / 2), 0.0, 0.0]
            target = sapien.Pose([0.0, 0.0, 0.0], turn)

        self.component.set_drive_target(target)

    def position(self) -> float:
        """Read the position of a hinge or slider, m or rad."""
        moved = self.component.relative_pose
        if self._kind == "slider":
            return float(moved.p[0])

        w, x, _, _ = moved.q
        return self._middle + math.remainder(2 * math.atan2(x, w), 2 * math.pi)


class _Pull:
    """The spring and latches of a hinge or slider: a force and how it changes with the position, at where it is.

    How it changes is the stiffness of the motor's spring, whose end is put where the joint is. So the force is implicit
    in the solver, and stable however steep it is.
    """

    def __init__(self, motor: _Motor, joint: Joint) -> None:
        self._motor = motor
        self._joint = joint
        self._turned = joint.start  # with whole turns
        self._slope = 0.0

    def act(self, time: float) -> None:
        joint = self._joint
        position = self._motor.position()
        moved = position - self._turned
        if joint.kind == "hinge":
            moved = math.remainder(moved, 2 * math.pi)

        self._turned += moved

        latches = sum(_find_slope(latch, position) for latch in joint.latches)
        slope = joint.stiffness + max(0.0, latches)
        if slope != self._slope:
            self._motor.resist(slope, joint.damping)
            self._slope = slope

        self._motor.aim(position)
        spring = joint.stiffness * (joint.rest - self._turned)
        self._motor.push(spring + latch_force(joint, position))


def _find_slope(latch: Latch, position: float) -> float:
    """Compute how a latch's force changes with the position, N/m or N m/rad."""
    away = position - latch.at
    if abs(away) >= latch.width:
        return 0.0

    steepest = latch.force * math.pi / latch.width
    return steepest * math.cos(math.pi * away / latch.width)


class _BallPull:
    """The spring of a ball joint: the motor's, with its end where the ball is, and a torque that pulls back."""

    def __init__(self, motor: _Motor, joint: Joint) -> None:
        self._motor = motor
        self._stiffness = joint.stiffness

    def act(self, time: float) -> None:
        turned = self._motor.component.relative_pose
        self._motor.component.set_drive_target(turned)

        w, x, y, z = turned.q
        turn = Rotation.from_quat([x, y, z, w]).as_rotvec()
        self._motor.push(-self._stiffness * turn)


class _Servo:
    """A motor that follows a schedule as the arm's do; ``time`` is 0 until the robot's motion begins.

    Args:
        motor: what moves.
        drive: the schedule, and the most that the motor does.
        tracking_rate: how fast it converges to its target, 1/s.
        time_step: seconds.
    """

    def __init__(
        self, motor: _Motor, drive: Drive, tracking_rate: float, time_step: float
    ) -> None:
        self._motor = motor
        self._drive = drive
        self._time_step = time_step

        self._speeds = np.append(np.diff(drive.positions) / np.diff(drive.times), 0.0)
        self._ahead = 1 / tracking_rate

        self._lift = Lift(time_step)
        stiffness = drive.force / _GIVES_WAY
        motor.resist(stiffness, stiffness / tracking_rate, drive.force)

    def act(self, time: float) -> None:
        drive = self._drive
        middle = time - self._time_step / 2  # of the time step
        if drive.repeats and middle > 0:
            middle %= drive.times[-1]

        speed = self._speeds[np.searchsorted(drive.times, middle) - 1]
        before = float(drive.sample(np.asarray(time - self._time_step)))
        # A wheel's schedule begins again a turn behind.
        off = math.remainder(before - self._motor.position(), 2 * math.pi)

        target = float(drive.sample(np.asarray(time))) + self._ahead * speed
        self._motor.aim(target + self._lift.add(off))
