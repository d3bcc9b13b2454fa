"""The ladder: families of scenes that are drawn from a level and a seed, and get harder without end."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {"ladder": "tasks.ladder.task:make_task"}
