"""``task=file``: a task from a YAML file, without a line of Python."""

from collections.abc import Mapping

from core.hooks import Command, Factories, hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {"file": "plugins.tasks.file.task:FileTask"}


@hookimpl
def commands() -> dict[str, Command]:
    return {
        "scene": Command(
            "write a scene file from a sentence and photographs",
            "plugins.tasks.file.bench.scene_command:main",
        )
    }


@hookimpl
def importers() -> Factories:
    return {"scene": "plugins.tasks.file.import_scene:take_scene"}
