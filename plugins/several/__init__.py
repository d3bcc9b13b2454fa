"""One tool for several tasks: ``task=several task.of=[NAME,...]``, with a plan for each task."""

from core.hooks import Factories, hookimpl


@hookimpl
def tasks() -> Factories:
    return {"several": "plugins.several.task:Several"}


@hookimpl
def action_representations() -> Factories:
    return {"several": "plugins.several.joined_plans:TaskActions"}
