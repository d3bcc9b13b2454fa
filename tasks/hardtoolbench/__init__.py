"""The tasks of HardToolBench, which a plan for one known layout doesn't solve."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {
        "LeverStone": "tasks.hardtoolbench.lever_stone:LeverStone",
        "LidAndBall": "tasks.hardtoolbench.lid_and_ball:LidAndBall",
        "OpenLatch": "tasks.hardtoolbench.open_latch:OpenLatch",
        "TurnDisc": "tasks.hardtoolbench.turn_disc:TurnDisc",
    }
