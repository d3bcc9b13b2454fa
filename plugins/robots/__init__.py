"""Robots: arms as data. The first one is the default."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def robots() -> Mapping[str, str]:
    return {
        "panda": "plugins.robots.panda:panda",
        "fr3": "plugins.robots.fr3:fr3",
        "kinova": "plugins.robots.kinova:kinova",
        "ur10": "plugins.robots.universal:ur10",
        "ur5": "plugins.robots.universal:ur5",
        "urdf": "plugins.robots.urdf:urdf",
        "xarm7": "plugins.robots.xarm:xarm7",
        "z1": "plugins.robots.z1:z1",
    }
