"""The tasks of HardToolBench, which a plan for one known layout doesn't solve."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {
        "PastGlasses": "tasks.hardtoolbench.past_glasses:PastGlasses",
        "StopCart": "tasks.hardtoolbench.stop_cart:StopCart",
        "SweepCards": "tasks.hardtoolbench.sweep_cards:SweepCards",
        "PourGrains": "tasks.hardtoolbench.pour_grains:PourGrains",
    }
