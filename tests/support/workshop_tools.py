"""Tools that are printed, loaded and cut."""

from core.design import Component, Tool
from core.geometry import Box, Pose
from core.values.materials import PAPER, Material
from core.values.printers import Printer
from plugins.results.workshop.body import bodies
from plugins.results.workshop.printing import print_part


def post(length, mass=0.1):
    return Tool(
        (
            Component(
                "post",
                "tool_mount",
                Pose.xyz_rpy((0, 0, -length / 2)),
                Box((0.02, 0.02, length)),
                mass,
            ),
        )
    )


PLA = Material("pla", 1240.0, infill=0.2, wall_mm=1.2, young_pa=2.3e9, strength_pa=26e6)


MINI = Printer((180.0, 180.0, 180.0))


def at(x, y, z):
    return Pose.xyz_rpy((x, y, z))


HOOK = Tool(
    (
        Component("block", "tool_mount", at(0, 0, -0.015), Box((0.05, 0.05, 0.02))),
        Component("arm", "block", at(0.1875, 0, -0.02), Box((0.415, 0.024, 0.02))),
        Component("tip", "arm", at(0.1975, 0, -0.035), Box((0.02, 0.024, 0.06))),
    )
)


def print_bodies(tool, printer, material=PAPER):
    return [
        print_part(
            body.link.name,
            body.link,
            body.mount.solid,
            body.weld_mm,
            printer,
            material,
            [body.one_piece],
        )
        for body in bodies(tool, printer)
    ]


def tool(*components, gripper=False):
    return Tool(components, gripper=gripper)


SOLID = Material("solid", 1240, young_pa=2.5e9, strength_pa=26e6)


NEWTONS = 10.0


def bar(name, parent, top, length, thick, mass=0.1):
    """A bar that hangs down; its ``top`` is in the frame of what bears it, whose middle is at 0."""
    return Component(
        name,
        parent,
        Pose.xyz_rpy((0.0, 0.0, top - length / 2)),
        Box((thick, thick, length)),
        mass,
    )
