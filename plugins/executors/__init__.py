"""Where candidates are tried: worker processes on this machine, or on a Ray cluster."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def executors() -> Mapping[str, str]:
    return {
        "local": "plugins.executors.local:LocalExecutor",
        "ray": "plugins.executors.ray:RayExecutor",
    }
