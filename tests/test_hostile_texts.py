"""Texts that a terminal, a file system or a parser could trip over, at each door where a text may stand.

At worst a text is refused, in a line that can be printed.
"""

import json

import pytest

from tests.support.refusing import Row, find_refusals, list_rows

TEXTS = {
    "escapes of a terminal": r"\u001b[2J\u001b]0;owned\u0007",
    "right to left": r"rod\u202egnp",
    "NUL": r"a\u0000b",
    "half of a pair": r"\ud800",
    "lines": r"a\nb\r\u2029c",
    "out of the folder": "../../../etc/passwd",
    "an address": "http://127.0.0.1:9/a.stl",
    "Python": "__import__(os).system(id)",
    "a template": "{{ 7 * 7 }} ${x} %(y)s",
    "letters of other scripts": r"\u0394\u4e2d\ufb01\ud83d\ude00",
    "a long one": "x" * 20_000,
    "nothing": "",
}
TEXT_OF = {row.door: row.text for row in list_rows()}
PLACES = [
    ("boxes", '"name": "rod"', '"name": "@"'),
    ("boxes", '"parent": "post"', '"parent": "@"'),
    ("boxes", '"gripper": false', '"gripper": false, "strategy_name": "@"'),
    ("boxes", '"gripper": false', '"gripper": false, "tool_description": "@"'),
    ("boxes", '"action": "waypoints"', '"action": "@"'),
    ("boxes", '"name": "post"', '"name": "post", "@": 3'),
    ("boxes", "[0.5, 0, 0.4,", '["@", 0, 0.4,'),
    ("urdf", "<link name='rod'>", "<link name='@'>"),
    ("urdf", "0.02 0 -0.1", "@ 0 -0.1"),
    ("urdf", "<box size='0.01 0.01 0.2'/>", "<mesh filename='@'/>"),
    ("solids", '{"sphere": 0.03}', '{"@": 0.03}'),
    ("solids", '"solid": {"box": [0.02, 0.02, 0.1]}', '"solid": "@"'),
    ("anchored", '"anchor": "cube"', '"anchor": "@"'),
    ("scene", "name: OpenDoor", 'name: "@"'),
    ("scene", "body: door", 'body: "@"'),
    ("scene", "    sphere: {radius: 0.04}", '    file: "@"'),
    ("scene", "every: true", 'every: true\n"@": 3'),
    ("settings", "task=BringCube", "task=@"),
    ("settings", "seed=1", "seed=1 robot.path=@"),
]


@pytest.mark.parametrize("place", PLACES, ids=lambda place: f"{place[0]}: {place[2]}")
@pytest.mark.parametrize("name", TEXTS)
def test_a_text_is_read_or_refused_in_a_short_line(name, place, tmp_path):
    door, old, new = place
    text = TEXTS[name]
    if door == "settings":  # a shell hands over no such characters
        text = text.replace("\\", "").replace(" ", "")
    row = Row(door, TEXT_OF[door], [old], [new.replace("@", text)], "", {})
    for refusal in find_refusals(row, row.new, tmp_path):
        assert len(json.dumps(refusal.dump())) < 2500
