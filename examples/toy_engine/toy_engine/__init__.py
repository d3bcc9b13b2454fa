"""An adapter of a toy engine: ``sim=toy``."""

from core.hooks import hookimpl


@hookimpl
def simulators() -> dict[str, str]:
    return {"toy": "toy_engine.simulator:ToySimulator"}


@hookimpl
def config_path() -> str:
    return "pkg://toy_engine.conf"
