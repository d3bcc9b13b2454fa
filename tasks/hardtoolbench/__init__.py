"""The tasks of HardToolBench, which a plan for one known layout doesn't solve."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {
        "AroundCorner": "tasks.hardtoolbench.around_corner:AroundCorner",
        "HangRing": "tasks.hardtoolbench.hang_ring:HangRing",
        "InsertPlug": "tasks.hardtoolbench.insert_plug:InsertPlug",
        "LeverStone": "tasks.hardtoolbench.lever_stone:LeverStone",
        "LidAndBall": "tasks.hardtoolbench.lid_and_ball:LidAndBall",
        "OpenLatch": "tasks.hardtoolbench.open_latch:OpenLatch",
        "PastGlasses": "tasks.hardtoolbench.past_glasses:PastGlasses",
        "PourGrains": "tasks.hardtoolbench.pour_grains:PourGrains",
        "StopCart": "tasks.hardtoolbench.stop_cart:StopCart",
        "SweepCards": "tasks.hardtoolbench.sweep_cards:SweepCards",
        "TurnDisc": "tasks.hardtoolbench.turn_disc:TurnDisc",
        "TwoStations": "tasks.hardtoolbench.two_stations:TwoStations",
    }
