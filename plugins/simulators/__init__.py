"""The engines: ``sim=pybullet``, ``sim=sapien``, ``sim=mujoco`` and ``sim=mujoco_warp``."""

from core.hooks import Factories, hookimpl


@hookimpl
def simulators() -> Factories:
    return {
        "pybullet": "plugins.simulators.pybullet.simulator:PyBulletSimulator",
        "sapien": "plugins.simulators.sapien.simulator:SapienSimulator",
        "mujoco": "plugins.simulators.mujoco.simulator:MuJoCoSimulator",
        "mujoco_warp": "plugins.simulators.mujoco.batched.simulator:MuJoCoWarpSimulator",
    }
