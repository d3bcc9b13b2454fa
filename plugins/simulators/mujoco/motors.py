"""Compute what the arm's motors apply, from what a world did."""

from __future__ import annotations

import numpy as np

from core.geometry import Array
from plugins.simulators.mujoco.contacts import is_discrete
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element

# Steps between two instants at which gravity's share is computed; it is linear in between.
_EVERY = 40


class Motors:
    """The arm's servos, and what compensates gravity; both are the motors'.

    MuJoCo's own number of a servo's force is that before the step. What acts is what its integrator makes of it: with
    the discrete one the force at the step's end, else one that depends on the speed there.

    Args:
        model: of the world; the arm's joints are its first.
        count: how many they are.
    """

    def __init__(self, model: Element, count: int) -> None:
        self._model = model
        self._count = count
        self._data = mujoco.MjData(model)
        # Views of MuJoCo's memory.
        self._qpos: Array = self._data.qpos
        self._gravcomp: Array = self._data.qfrc_gravcomp
        joints = model.actuator_trnid[:count, 0]
        self._positions = model.jnt_qposadr[joints]
        self._speeds = model.jnt_dofadr[joints]
        self._stiffness = -model.actuator_biasprm[:count, 1]
        self._damping = -model.actuator_biasprm[:count, 2]
        limited = model.jnt_actfrclimited[joints].astype(bool)
        self._most = np.where(limited, model.jnt_actfrcrange[joints, 1], np.inf)
        self._discrete = is_discrete(model.opt)

    def compute(
        self, qpos: Array, qvel: Array, targets: Array, speeds: Array, steps: Array
    ) -> Array:
        """Compute the torques of some of S steps (M, J), N m.

        Args:
            qpos: positions before the first step, and after each (S + 1, Q).
            qvel: speeds, as well (S + 1, V).
            targets: that the servos got (S, J).
            speeds: of the targets (S, J).
            steps: which steps (M,), counted from 1.
        """
        at = steps if self._discrete else steps - 1
        reached = qpos[at][:, self._positions]
        springs = self._stiffness * (targets[steps - 1] - reached)
        missing = speeds[steps - 1] - qvel[steps][:, self._speeds]
        torques = springs + self._damping * missing + self._bear(qpos[1:], steps - 1)

        clipped: Array = np.clip(torques, -self._most, self._most)
        return clipped

    def _bear(self, qpos: Array, wanted: Array) -> Array:
        """Compute what bears the weight of the arm and its tool (M, J), at some of the positions (S, Q)."""
        last = len(qpos) - 1
        known = np.append(np.arange(0, last, _EVERY), last)
        found = np.array([self._compensate(qpos[number]) for number in known])
        joints = [np.interp(wanted, known, joint) for joint in found.T]

        return np.stack(joints, axis=-1)

    def _compensate(self, qpos: Array) -> Array:
        """Compute what compensates gravity (J,) at positions (Q,)."""
        model = self._model
        data = self._data
        self._qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        if model.nflex:
            mujoco.mj_flex(model, data)

        mujoco.mj_passive(model, data)
        torques: Array = self._gravcomp[self._speeds]
        return torques
