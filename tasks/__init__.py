"""The twelve tasks of RoboToolBench."""

from collections.abc import Mapping

from core.hooks import hookimpl


@hookimpl
def tasks() -> Mapping[str, str]:
    return {
        "BringCube": "tasks.bring_cube:BringCube",
        "CleanTable": "tasks.clean_table:CleanTable",
        "DislodgeCube": "tasks.dislodge_cube:DislodgeCube",
        "ElevatePlate": "tasks.elevate_plate:ElevatePlate",
        "GatherSpheres": "tasks.gather_spheres:GatherSpheres",
        "HighObject": "tasks.high_object:HighObject",
        "LiftBox": "tasks.lift_box:LiftBox",
        "MoveBall": "tasks.move_ball:MoveBall",
        "OneBook": "tasks.one_book:OneBook",
        "ScoreGoal": "tasks.score_goal:ScoreGoal",
        "SnatchCookie": "tasks.snatch_cookie:SnatchCookie",
        "TurkeyLegs": "tasks.turkey_legs:TurkeyLegs",
    }
