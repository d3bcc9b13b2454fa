"""``executor=ray``: workers on a Ray cluster."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def executors() -> Mapping[str, str]:
    return {"ray": "plugins.executors.ray.executor:RayExecutor"}
