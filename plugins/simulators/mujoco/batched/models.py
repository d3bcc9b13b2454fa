"""A world's model as what it shares with others and what is its own.

Tools have as many boxes as their neighbours in a batch, some of them unused and far away. MuJoCo compiles each tool's
model as it does for `sim=mujoco`; what then differs between two of them MuJoCo Warp can hold for each world.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.scene import Inertia, Scene, State
from plugins.simulators.mujoco import robot
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element
from plugins.simulators.mujoco.world import described, state

PER_WORLD = (  # of a tool and what it changes in the arm that bears it
    *("geom_size", "geom_pos", "geom_quat", "geom_rbound", "geom_aabb"),
    *("body_mass", "body_inertia", "body_ipos", "body_iquat", "body_subtreemass", "body_invweight0"),
    *("dof_invweight0", "actuator_acc0", "actuator_biasprm"),
    *("qpos0", "qpos_spring", "body_pos", "body_quat"),  # of a layout
)
# Fields that Warp does not look at.
_UNUSED = {"bvh_aabb", "bvh_nodeid", "bvh_child", "bvh_depth", "body_sameframe", "geom_sameframe", "dof_M0"}
_FEWEST_SLOTS = 4
_LEAST_FRICTION = 1e-5  # mjMINMU


@dataclass(frozen=True, eq=False)
class Figures:
    """What is a world's own.

    ``shared`` names what it shares with others: worlds with the same one can be in a batch. ``fields`` are those of
    `PER_WORLD`; ``geom_xpos`` (G, 3) and ``geom_xmat`` (G, 3, 3) are where geoms stand that can't move; ``stiffness``
    and ``damping`` (J,) are the servos', ``names`` the free bodies'.
    """

    shared: str
    names: tuple[str, ...]
    fields: Mapping[str, Array]
    geom_xpos: Array
    geom_xmat: Array
    stiffness: Array
    damping: Array

    def state(self, numbers: Array) -> State:
        """Of the free bodies, from positions and speeds (..., Q + V)."""
        joints, bodies = len(self.stiffness), len(self.names)
        positions = numbers[..., joints : joints + 7 * bodies]
        return state(self.names, positions, numbers[..., 2 * joints + 7 * bodies :])


@dataclass(frozen=True)
class Size:
    """Of a batch: worlds, frames of a film, instants of a trajectory, and room for contacts in each world."""

    worlds: int
    frames: int
    instants: int
    contacts: int


@dataclass(frozen=True, eq=False)
class Played:
    """What came of a world: states as positions and then speeds (Q + V,), the largest lag of an arm joint, and whether
    it exploded, or had more contacts than there was room for. ``film`` (F, Q + V) is without the end.
    """

    start: Array
    end: Array
    film: Array
    lag: float
    broken: bool
    crowded: bool


def slots(tool: Tool) -> int:
    """Boxes on each mount of the model that is made for a tool: 4, 8, 16 and so on."""
    most = max(Counter(mount for mount, _ in tool.placed().values()).values(), default=0)
    return _FEWEST_SLOTS << max(0, int(np.ceil(np.log2(max(most, 1) / _FEWEST_SLOTS))))


def model(
    scene: Scene, inertias: dict[str, Inertia], tool: Tool, time_step: float, tracking_rate: float, slip_rate: float
) -> Element:
    """As `plugins.simulators.mujoco.world.compiled`, but with unused boxes, and with what Warp does not have put in
    another way that comes to the same.
    """
    spec = described(scene, inertias, tool, time_step, slip_rate, slots(tool))
    for servo in spec.actuators:  # Warp has no servos with two inputs; a force and a spring with damper make one
        servo.set_to_position(kp=1.0, kv=1.0)
    made = spec.compile()
    robot.set_gains(made, tracking_rate)
    made.actuator_gainprm[:, 0] = 1.0
    for friction in (made.geom_friction, made.pair_friction):  # as MuJoCo does itself
        np.maximum(friction, _LEAST_FRICTION, out=friction)
    # No world is put back to its start by Warp anyway.
    made.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    # It says when something may sleep; the arm, which it differs for with the tool, never does.
    made.dof_length[: made.nactuator] = 1.0
    return made


def figures(made: Element, scene: Scene) -> Figures:
    """Of a `model` of that scene."""
    data = mujoco.MjData(made)
    mujoco.mj_kinematics(made, data)
    return Figures(
        _shared(made),
        tuple(body.name for body in scene.free),
        {name: np.array(getattr(made, name)) for name in PER_WORLD},
        data.geom_xpos.copy(),
        data.geom_xmat.reshape(-1, 3, 3).copy(),
        -made.actuator_biasprm[:, 1],
        -made.actuator_biasprm[:, 2],
    )


def _shared(made: Element) -> str:
    """A digest of all numbers but those that are a world's own."""
    digest = hashlib.blake2b(digest_size=16)
    for part in (made, made.opt):
        for name in sorted(dir(part)):
            if name.startswith("_") or (part is made and name in {*PER_WORLD, *_UNUSED}):
                continue
            value = getattr(part, name)
            if isinstance(value, np.ndarray | int | float):
                digest.update(name.encode() + np.asarray(value).tobytes())
    return digest.hexdigest()
