"""Draw tools at random, and read what a model is told of a representation."""

import string

from hypothesis import strategies as st

from core.design import Component, Tool
from core.geometry import Box, Pose
from core.interfaces import Brief
from plugins.actions.waypoints import WaypointActions
from plugins.tools.components import robot_names
from tasks.one_book import OneBook
from tests.support.panda import PANDA, on_panda

# Hypothesis also tries the literals that it finds in the code, and so the names of the robot's own links.
ROBOT_NAMES = robot_names(PANDA)


def grid(low, high):
    """Numbers of six decimals, which URDF text of nine digits holds."""
    return st.integers(round(low * 1e6), round(high * 1e6)).map(lambda n: n / 1e6)


@st.composite
def tools(draw):
    gripper = draw(st.booleans())
    names = draw(
        st.lists(
            st.text(string.ascii_letters + "_.-0", min_size=1, max_size=64).filter(
                lambda name: name not in ROBOT_NAMES
            ),
            min_size=1,
            max_size=6,
            unique=True,
        )
    )
    parents = list(Tool(gripper=gripper).mounts)
    components = []
    for name in names:
        xyz = [draw(grid(-0.5, 0.5)) for _ in range(3)]
        rpy = draw(grid(-3.1, 3.1)), draw(grid(-1.5, 1.5)), draw(grid(-3.1, 3.1))
        box = Box(tuple(draw(grid(0.001, 2)) for _ in range(3)))
        color = tuple(draw(grid(0.2, 1)) for _ in range(4))
        parent = draw(st.sampled_from(parents))
        components.append(
            Component(
                name, parent, Pose.xyz_rpy(xyz, rpy), box, draw(grid(0.001, 1)), color
            )
        )
        parents.append(name)
    return Tool(tuple(components), gripper)


def instructions_of(tools):
    """What a model is told of a tool, on one line."""
    counts = dict.fromkeys(("n_tool", "n_action", "generation", "agent", "seed"), 1)
    brief = Brief(
        on_panda(OneBook()), 0, tools, False, **counts, actions=WaypointActions()
    )
    return " ".join(tools.instructions(brief).split())
