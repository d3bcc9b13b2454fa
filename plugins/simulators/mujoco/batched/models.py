"""Split a world's model into what it shares with other worlds and what is its own.

All tools in a batch have equally many boxes, some of them unused and far away. MuJoCo compiles each tool's model as for
`sim=mujoco`; MuJoCo Warp can hold the remaining differences for each world.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.scene import Scene, State
from core.values.robots import Robot
from plugins.simulators.mujoco.arm import Joints
from plugins.simulators.mujoco.bodies import state
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.model import build_spec
from plugins.simulators.mujoco.robot import set_gains
from plugins.simulators.mujoco.shapes import Element

# Fields that depend on the tool.
PER_WORLD = (
    "geom_size",
    "geom_pos",
    "geom_quat",
    "geom_rbound",
    "geom_aabb",
    "body_mass",
    "body_inertia",
    "body_ipos",
    "body_iquat",
    "body_subtreemass",
    "body_invweight0",
    "dof_invweight0",
    "actuator_acc0",
    "actuator_biasprm",
    "jnt_stiffness",
    "dof_frictionloss",
    # And on the layout.
    "qpos0",
    "qpos_spring",
    "body_pos",
    "body_quat",
)
# Fields that Warp does not use.
_UNUSED = {
    "bvh_aabb",
    "bvh_nodeid",
    "bvh_child",
    "bvh_depth",
    "body_sameframe",
    "geom_sameframe",
    "dof_M0",
}
_FEWEST_SLOTS = 4
_LEAST_FRICTION = 1e-5  # mjMINMU


@dataclass(frozen=True, eq=False)
class ModelFigures:
    """The figures of a model that are a world's own.

    Attributes:
        shared: a digest of the others: worlds with the same digest can be in a batch.
        names: the free bodies'.
        fields: those of `PER_WORLD`.
        geom_xpos: where fixed geoms are (G, 3).
        geom_xmat: how they are turned (G, 3, 3).
        stiffness: the servos' (J,).
        damping: the servos' (J,).
        joints: where the robot's are among the positions (Q,).
    """

    shared: str
    names: tuple[str, ...]
    fields: Mapping[str, Array]
    geom_xpos: Array
    geom_xmat: Array
    stiffness: Array
    damping: Array
    joints: Joints

    def state(self, numbers: Array) -> State:
        """Convert positions and speeds (..., Q + V) to the state of the free bodies."""
        joints = self.joints.count
        bodies = len(self.names)
        positions = numbers[..., joints : joints + 7 * bodies]
        return state(self.names, positions, numbers[..., 2 * joints + 7 * bodies :])


@dataclass(frozen=True)
class Size:
    """A batch's capacity.

    Attributes:
        worlds: how many are stepped together.
        frames: notes of a world in a block.
        instants: times of a trajectory.
        contacts: in each world.
    """

    worlds: int
    frames: int
    instants: int
    contacts: int


def slots(tool: Tool) -> int:
    """Count the boxes on each mount of a tool's model: 4, 8, 16 and so on."""
    counts = Counter(mount for mount, _ in tool.placed().values())
    found = _FEWEST_SLOTS
    while found < max(counts.values(), default=0):
        found *= 2
    return found


def model(
    robot: Robot,
    scene: Scene,
    tool: Tool,
    time_step: float,
    tracking_rate: float,
    slip_rate: float,
) -> Element:
    """Compile as `mujoco.model.compile_model`, with unused boxes, and equivalents for what Warp lacks."""
    spec = build_spec(robot, scene, tool, time_step, slip_rate, slots(tool))
    # Warp has no servo with two inputs; a force, a spring and a damper make one.
    for servo in spec.actuators:
        servo.set_to_position(kp=1.0, kv=1.0)
    compiled = spec.compile()
    set_gains(compiled, robot, tool, tracking_rate)
    compiled.actuator_gainprm[:, 0] = 1.0
    # As MuJoCo does itself.
    for friction in (compiled.geom_friction, compiled.pair_friction):
        np.maximum(friction, _LEAST_FRICTION, out=friction)
    # Warp never resets a world anyway.
    compiled.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    # It decides when bodies sleep. It differs with the tool for the arm only, which never sleeps.
    compiled.dof_length[: compiled.nactuator] = 1.0
    return compiled


def extract_figures(compiled: Element, scene: Scene, joints: Joints) -> ModelFigures:
    """Extract a world's own figures from a `model` of that scene."""
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    return ModelFigures(
        _shared(compiled),
        tuple(body.name for body in scene.free),
        {name: np.array(getattr(compiled, name)) for name in PER_WORLD},
        data.geom_xpos.copy(),
        data.geom_xmat.reshape(-1, 3, 3).copy(),
        -compiled.actuator_biasprm[:, 1],
        -compiled.actuator_biasprm[:, 2],
        joints,
    )


def _shared(compiled: Element) -> str:
    """Compute a digest of all numbers but those that are a world's own."""
    digest = hashlib.blake2b(digest_size=16)
    for part, left_out in ((compiled, {*PER_WORLD, *_UNUSED}), (compiled.opt, set())):
        for name in sorted(dir(part)):
            if name.startswith("_") or name in left_out:
                continue
            value = getattr(part, name)
            if isinstance(value, np.ndarray | int | float):
                digest.update(name.encode() + np.asarray(value).tobytes())
    return digest.hexdigest()
