"""RoboToolBench, task by task."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {
        "BringCube": "tasks.bring_cube:BringCube",
        "OneBook": "tasks.one_book:OneBook",
    }
