"""``task=file``: a task from a YAML file, without a line of Python."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {"file": "plugins.tasks.file.task:FileTask"}
