"""A task, ``task=PushButton``, and a search strategy, ``evolution=restarts``."""

from core.hooks import hookimpl


@hookimpl
def tasks() -> dict[str, str]:
    return {"PushButton": "push_button.task:PushButton"}


@hookimpl
def evolution_strategies() -> dict[str, str]:
    return {"restarts": "push_button.search:Restarts"}


@hookimpl
def config_path() -> str:
    return "pkg://push_button.conf"
