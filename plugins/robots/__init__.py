"""Robots: arms as data. The first one is the default."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def robots() -> Mapping[str, str]:
    return {"panda": "plugins.robots.panda:panda", "urdf": "plugins.robots.urdf:urdf"}
