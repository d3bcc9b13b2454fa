"""RoboToolBench, task by task."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {
        "BringCube": "tasks.bring_cube:BringCube",
        "ElevatePlate": "tasks.elevate_plate:ElevatePlate",
        "GatherSpheres": "tasks.gather_spheres:GatherSpheres",
        "LiftBox": "tasks.lift_box:LiftBox",
        "OneBook": "tasks.one_book:OneBook",
    }
