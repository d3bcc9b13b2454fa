"""Hostile replies by what is wrong with them, and a sound one."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from functools import cache
from typing import Any

from core.interfaces import Task
from core.plugins import installed
from tests.support.text import replaced_all

ROD = """\
<link name="rod">
  <visual><geometry><box size="0.02 0.02 0.1"/></geometry></visual>
  <collision><geometry><box size="0.02 0.02 0.1"/></geometry></collision>
  <inertial><mass value="0.02"/></inertial>
</link>
<joint name="rod_joint" type="fixed"><parent link="panda_virtual"/><child link="rod"/><origin xyz="0 0 -0.055"/></joint>
"""


def sound(**changes: Any) -> dict[str, Any]:
    """Return a strategy that keeps the rules, except for the ``changes``."""
    plan = [[0.5, 0.0, 0.4, 0.0, 0.0, 0.0], [0.45, 0.1, 0.4, 0.0, 0.0, 0.5]]
    return {
        "strategy_name": "poke",
        "gripper": False,
        "tool_urdf": ROD,
        "action_sets": [plan],
        **changes,
    }


def reply_of(*strategies: Any) -> str:
    return json.dumps({"strategies": list(strategies)})


@cache
def bring_cube() -> Task:
    return installed().create("task", "BringCube")


def tool_reply(name: str) -> str:
    """Return a reply that is sound except for its tool, one of `TOOLS`."""
    return reply_of(sound(tool_urdf=_text(TOOLS[name])))


def reply(name: str) -> str:
    """Return one of `REPLIES`."""
    return _text(REPLIES[name])


def _text(value: str | Callable[[], str]) -> str:
    return value if isinstance(value, str) else value()


def mesh(file: str) -> str:
    return replaced_all(
        ROD, ('<box size="0.02 0.02 0.1"/>', f'<mesh filename="{file}"/>')
    )


def named(name: str) -> str:
    return replaced_all(ROD, ('"rod"', f'"{name}"'))


def sized(x: str) -> str:
    return replaced_all(ROD, ("0.02 0.02 0.1", f"{x} 0.02 0.1"))


def weighing(mass: str) -> str:
    return replaced_all(ROD, ('mass value="0.02"', f'mass value="{mass}"'))


def many(count: int) -> str:
    one = '<link name="b{i}"><collision><geometry><box size=".02 .02 .02"/></geometry></collision></link>'
    joint = '<joint name="j{i}" type="fixed"><parent link="panda_virtual"/><child link="b{i}"/></joint>'
    return "".join(replaced_all(one + joint, ("{i}", str(i))) for i in range(count))


def boxes(count: int, step: float = 0.01) -> str:
    """One link of many boxes, each as visual and as collision shape, in opposite order."""
    shapes = [
        f'<{tag}><origin xyz="0 {i * step:g} 0"/><geometry><box size=".01 .01 .03"/></geometry></{tag}>'
        for tag, order in (
            ("collision", range(count)),
            ("visual", reversed(range(count))),
        )
        for i in order
    ]
    return f'<link name="b">{"".join(shapes)}</link>{hung("b", "panda_virtual")}'


def hung(child: str, parent: str, at: str = "0 0 0") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
    return f'<joint name="{child}_j" type="fixed">{ends}</joint>'


def frames(count: int, at: str) -> str:
    """A chain of links without shapes, which begins at a link."""
    chain = [at, *(f"f{i}" for i in range(count))]
    return "".join(
        f'<link name="{b}"/>{hung(b, a)}' for a, b in itertools.pairwise(chain)
    )


def bomb() -> str:
    entities = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10))
    return f'<!DOCTYPE r [<!ENTITY a0 "ha">{entities}]><link name="&a9;"/>'


def quadratic() -> str:
    return (
        f'<!DOCTYPE r [<!ENTITY a "{"x" * 100_000}">]><link name="{"&a;" * 10_000}"/>'
    )


# Large ones are made when they are needed.
TOOLS: dict[str, str | Callable[[], str]] = {
    "billion laughs": bomb(),
    "quadratic blow-up": quadratic(),
    "parameter entity": f'<!DOCTYPE r [<!ENTITY % x SYSTEM "file:///etc/passwd"> %x;]>{ROD}',
    "entity in UTF-16": f'<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE r [<!ENTITY x "y">]>{ROD}',
    "mesh that climbs": mesh("../../../../etc/shadow"),
    "mesh of the web": mesh("http://127.0.0.1:9/a.stl"),
    "texture": replaced_all(
        ROD,
        (
            "</visual>",
            '<material name="m"><texture filename="/etc/passwd"/></material></visual>',
        ),
    ),
    "XInclude": '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="/etc/passwd"/>'
    + ROD,
    "stylesheet": f'<?xml-stylesheet href="http://127.0.0.1:9/x.xsl"?>{ROD}',
    "xacro": '<xacro:property xmlns:xacro="x" name="a" value="${__import__(\'os\').system(\'id\')}"/>',
    "plugin of Gazebo": '<gazebo><plugin filename="libc.so.6" name="x"/></gazebo>'
    + ROD,
    "name is Python": named("__import__('os').system('id')"),
    "name has NUL": named("a\x00b"),
    "name is an escape sequence": named("\x1b[2J\x1b]0;owned\x07"),
    "name turns the line": named("rod\u202egnp"),
    "name of a million letters": named("a" * 990_000),
    "million components": lambda: many(1) * 1_000_000,
    "ten thousand components": many(9_000)[:999_000],
    "box of 1e-300 m": sized("1e-300"),
    "box with a million numbers": sized("0.1 " * 200_000),
    "mass of nothing": weighing("5e-324"),
    "wire of 1e-12 kg": replaced_all(
        weighing("1e-12"), ("0.02 0.02 0.1", "0.0005 0.0005 0.1")
    ),
    "wire in pieces": "".join(
        f'<link name="w{i}"><collision><geometry><box size=".001 .001 .005"/></geometry></collision></link>'
        + hung(f"w{i}", f"w{i - 1}" if i else "panda_virtual", "0 0 -.005")
        for i in range(30)
    ),
    "180 m long": "".join(
        f'<link name="w{i}"><collision><geometry><box size=".02 .02 2"/></geometry></collision></link>'
        + hung(f"w{i}", f"w{i - 1}" if i else "panda_virtual", "0 0 -1.8")
        for i in range(100)
    ),
    "angle of 1e300": replaced_all(
        ROD, ('xyz="0 0 -0.055"', 'xyz="0 0 -0.055" rpy="1e300 0 0"')
    ),
    "nested without end": "<link>" * 100_000,
    "nested and closed": "<a>" * 50_000 + "</a>" * 50_000,
    "attributes without end": "<link "
    + " ".join(f'a{i}="1"' for i in range(60_000))
    + "/>",
    "one attribute twice": '<link name="a" name="b"/>',
    "CDATA without end": f"<![CDATA[{ROD}",
    "comment without end": "<!--" + "-" * 500_000,
    "whitespace without end": " " * 999_999,
    "numbers of digits without end": sized("1" * 500_000),
    "number that can be split in many ways": weighing("1" * 900_000 + "x"),
    "exponent that can be split in many ways": weighing("1e" + "1" * 900_000 + "e"),
    "link of a thousand boxes": boxes(1_000),
    "chain of frames behind many boxes": boxes(90) + frames(2_500, "b"),
    "text of ten million": lambda: "x" * 10_000_000,
}

_WAYPOINT = [0.5, 0.0, 0.4, 0.0, 0.0, 0.0]


def planned(plan: Any) -> str:
    return reply_of(sound(action_sets=[plan]))


def raw(plan: str) -> str:
    return replaced_all(reply_of(sound(action_sets="PLAN")), ('"PLAN"', plan))


REPLIES: dict[str, str | Callable[[], str]] = {
    "nothing": "",
    "a refusal": "I can't help with that.",
    "million waypoints": lambda: planned([_WAYPOINT] * 100_000),
    "million plans": lambda: raw(
        "[" + ",".join(["[[0.5,0,0.4,0,0,0]]"] * 200_000) + "]"
    ),
    "million strategies": lambda: (
        '{"strategies": [' + ",".join(["{}"] * 1_000_000) + "]}"
    ),
    "waypoint of a million numbers": lambda: raw(
        "[[[" + ",".join(["0"] * 1_000_000) + "]]]"
    ),
    "waypoint of 1e300": planned([[1e300, 0, 0.4, 0, 0, 0]]),
    "waypoint of a million digits": raw(
        "[[[" + "9" * 1_000_000 + ", 0, 0.4, 0, 0, 0]]]"
    ),
    "waypoint of Python": planned([["__import__('os').system('id')", 0, 0.4, 0, 0, 0]]),
    "angle of 1e6": planned([[0.5, 0, 0.4, 1e6, 0, 0]]),
    "nested without end": "[" * 2_000_000,
    "objects without end": '{"a":' * 500_000,
    "strategies nested without end": '{"strategies":' + "[" * 1_000_000,
    "plans nested without end": raw("[" * 50_000 + "]" * 50_000),
    "quotes without end": '{"strategies": [{"strategy_name": "' + '\\"' * 1_000_000,
    "braces without end": "{" * 3_000_000,
    "keys of one name": '{"strategies": [], ' * 1000 + '"strategies": 3' + "}" * 1000,
    "prototype": reply_of(
        {"__proto__": {"x": 1}, "__class__": "os.system", "constructor": "x"}
    ),
    "lone surrogates": '{"strategies": [{"strategy_name": "\\ud800", "tool_urdf": "\\udfff", "action_sets": [[]]}]}',
    "NULs": "\x00" * 1_000_000 + "{",
    "byte order mark": "\ufeff" + "{" * 10,
    "name is an escape sequence": reply_of(
        sound(strategy_name="\x1b]8;;http://x\x07\x1b[2J", action_sets=[])
    ),
    "name of ten million": lambda: reply_of(
        sound(strategy_name="x" * 10_000_000, action_sets=[])
    ),
    "strategies inside each other": '{"strategies":['
    + '{"parents":0,"a":[' * 90
    + "[]," * 1_600_000
    + "x",
    "a hundred megabytes of text": lambda: "x" * 100_000_000,
    "a hundred megabytes of braces": lambda: "{ " * 50_000_000,
    "a hundred megabytes of plan": lambda: (
        '{"strategies": [{"action_sets": [' + "[0,0,0,0,0,0]," * 7_000_000
    ),
}
