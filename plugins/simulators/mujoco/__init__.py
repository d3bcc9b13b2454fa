"""The MuJoCo engine."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def simulators() -> Mapping[str, str]:
    return {
        "mujoco": "plugins.simulators.mujoco.simulator:MuJoCoSimulator",
        "mujoco_warp": "plugins.simulators.mujoco.batched.simulator:MuJoCoWarpSimulator",
    }
