"""The SAPIEN engine: PhysX on the CPU."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def simulators() -> Mapping[str, str]:
    return {"sapien": "plugins.simulators.sapien.simulator:SapienSimulator"}
