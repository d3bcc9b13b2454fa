"""Tools written down as URDF."""

from core.hooks import Factories, hookimpl


@hookimpl
def tool_representations() -> Factories:
    return {"urdf": "plugins.tools.urdf.representation:UrdfTools"}
