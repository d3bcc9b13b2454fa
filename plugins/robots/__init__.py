"""Robots: arms as data. The first one is the default."""

from collections.abc import Mapping

from core.hooks import Factories, hookimpl


@hookimpl
def robots() -> Mapping[str, str]:
    return {
        "panda": "plugins.robots.arms:panda",
        "fr3": "plugins.robots.arms:fr3",
        "kinova": "plugins.robots.arms:kinova",
        "ur10": "plugins.robots.arms:ur10",
        "ur5": "plugins.robots.arms:ur5",
        "urdf": "plugins.robots.urdf:urdf",
        "xarm7": "plugins.robots.arms:xarm7",
        "z1": "plugins.robots.arms:z1",
    }


@hookimpl
def importers() -> Factories:
    return {
        "arm": "plugins.robots.import_arm:take_arm",
        "gripper": "plugins.robots.import_arm:take_gripper",
    }
