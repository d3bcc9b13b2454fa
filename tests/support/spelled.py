"""Designs in other spellings."""

import html
import json
import re

from core.design import DesignError
from core.designs.reading import read_designs
from core.designs.replies import parse_reply
from core.plugins import installed
from plugins.actions.waypoints import WaypointActions
from tests.support.hostile import bring_cube
from tests.support.text import replaced_all

RAW = (
    '<link name="rod"><collision><geometry><box size="0.02 0.02 0.1"/></geometry></collision></link>'
    '<joint name="rod_joint" type="fixed"><parent link="tool_mount"/><child link="rod"/>'
    '<origin xyz="0 0 -0.055" rpy="0 0 0"/></joint>'
)


POSES = [
    [0.5, 0, 0.5, 0, 0, 1.5707963267948966],
    [0.62, -0.25, 0.42, 0, 0, 1.5707963267948966],
]


def spell(entry):
    """Return the text of an entry of `ENTRIES`."""
    waypoints = []
    for pose in POSES:
        waypoint = entry.get("waypoint", "[X, Y, Z, R, P, W]")
        for letter, number in zip("XYZRPW", pose, strict=True):
            waypoint = re.sub(rf"\b{letter}\b", str(number), waypoint)
        waypoints.append(waypoint)
    plan = f"[{', '.join(waypoints)}]"
    lines = RAW.replace("><", ">\n<").splitlines()
    strategy = f'{{"strategy_name": "s", "tool_urdf": {json.dumps(RAW)}, "action_sets": [{plan}]}}'
    document = f'{{"strategies": [{strategy}]}}'
    parts = {
        "TWICEESC": json.dumps(json.dumps(document)[1:-1])[1:-1],
        "STRATESC": json.dumps(strategy)[1:-1],
        "ESCAPED": json.dumps(document)[1:-1],
        "DOC": document,
        "STRATEGY": strategy,
        "SECOND": replaced_all(strategy, ('"s"', '"t"')),
        "OTHER": strategy.replace("0.62", "9"),  # an entry's own waypoint may lack it
        "DIGITS": "1" * 90 + "x",
        "LINES": json.dumps(lines),
        "HTML": html.escape(RAW),
        "QUOT": RAW.replace('"', "&quot;"),
        "TWICE": RAW.replace('"', '\\\\\\"'),
        "URDF": json.dumps(RAW),
        "RAW": RAW,
        "PLAN": plan,
    }
    text = re.sub("|".join(parts), lambda part: parts[part[0]], entry["reply"])
    if "swap" in entry:
        text = replaced_all(text, entry["swap"])
    return text


def read(text):
    """Read a reply as the designer does; return its candidates and all reasons."""
    tools = installed().create("tool", "urdf")
    try:
        document = parse_reply(text)
        found = read_designs(
            document, tools, bring_cube(), most=(10, 10), actions=WaypointActions()
        )
    except DesignError as error:
        return [], [str(error)]
    return found, [candidate.problem for candidate in found if candidate.problem]
