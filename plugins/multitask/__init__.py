"""One tool for several tasks: ``task=multitask task.of=[NAME,...]``, with a plan for each task."""

from core.hooks import Factories, hookimpl


@hookimpl
def tasks() -> Factories:
    return {"multitask": "plugins.multitask.task:Multitask"}


@hookimpl
def action_representations() -> Factories:
    return {"multitask": "plugins.multitask.joined_plans:TaskActions"}
