"""How models write tools: ``tool=urdf``, ``tool=boxes`` and ``tool=solids``; and given tools, for which only plans are
designed: ``tool=none``, ``tool=known`` and ``tool=rlbench``. With a library, ``tool=known`` only begins with them. And
the rules for their joints, their grips and their stiffness.
"""

from core.hooks import Factories, hookimpl


@hookimpl
def tool_rules() -> Factories:
    return {
        "grips": "plugins.tools.grip_rules:check_grips",
        "joints": "plugins.tools.joint_rules:check_joints",
        "stiffness": "core.designs.stiffness:check_stiffness",
    }


@hookimpl
def tool_representations() -> Factories:
    return {
        "urdf": "plugins.tools.urdf.representation:UrdfTools",
        "boxes": "plugins.tools.boxes:BoxTools",
        "solids": "plugins.tools.solids.representation:SolidTools",
        "none": "plugins.tools.given:BareGripper",
        "known": "plugins.tools.given:make_known_tools",
        "rlbench": "plugins.tools.given:RLBenchTools",
    }
