"""The PyBullet engine."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def simulators() -> Mapping[str, str]:
    return {"pybullet": "plugins.simulators.pybullet.simulator:PyBulletSimulator"}
