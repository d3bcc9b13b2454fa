"""The tasks of SoftToolBench, with ropes, cloths and soft solids. MuJoCo alone plays them."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {
        "GatherBall": "tasks.softtoolbench.gather_ball:GatherBall",
        "HangCloth": "tasks.softtoolbench.hang_cloth:HangCloth",
        "PullRope": "tasks.softtoolbench.pull_rope:PullRope",
        "SpreadSlab": "tasks.softtoolbench.spread_slab:SpreadSlab",
    }
