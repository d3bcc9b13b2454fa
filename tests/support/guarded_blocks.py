"""A block, a tool above it, and the waypoints of plans that feel it."""

from core.geometry import Box
from core.scene import Body
from plugins.conformance.sample_tools import stick
from plugins.conformance.worlds import GREY, HOME, Bodies

TOP = 0.1


BLOCK = Body.of(
    "block", Box((0.2, 0.2, TOP)), (0.55, 0.0, TOP / 2), mass=0.0, color=GREY
)


TOOL = stick(0.2)


ABOVE = {"anchor": "block", "offset": [0, 0, 0.3]}


DOWN = {"anchor": "block", "offset": [0, 0, 0.2], "until": "touch", "speed": 0.05}


UP = {"anchor": "here", "offset": [0, 0, 0.05]}


class Block(Bodies):
    home = HOME

    def __init__(self):
        super().__init__(BLOCK)
