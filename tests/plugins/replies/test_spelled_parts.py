"""One sound design of boxes with an anchored plan in the spellings of models: it is read, or its fault is named."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from core.design import DesignError
from core.designs.reading import read_designs
from core.designs.replies import parse_reply
from core.plugins import installed
from tests.support.hostile import bring_cube
from tests.support.text import replaced_all

TURN = 1.5707963267948966
BOX = {
    "name": "shaft",
    "parent": "tool_mount",
    "shape": "box",
    "size": [0.02, 0.03, 0.1],
    "position": [0, 0, -0.05],
    "rpy": [0, 0, 0],
    "mass": 0.005,
}
ROD = {
    "name": "foot",
    "parent": "shaft",
    "shape": "cylinder",
    "radius": 0.02,
    "length": 0.04,
    "position": [0, 0, -0.11],
    "rpy": [0, TURN, 0],
    "mass": 0.005,
}
STEP = {
    "anchor": "cube",
    "offset": [-0.08, 0, 0.3],
    "rpy": [0, 0, TURN],
    "speed": 0.2,
}
LAST = {
    "anchor": "cube",
    "toward": "goal",
    "share": 1,
    "offset": [-0.04, 0, 0.2],
    "wait": 0.5,
}
GROUPS = yaml.safe_load(Path(__file__).with_name("spelled_parts.yaml").read_text())
ENTRIES = {
    f"{group}: {name}": entry
    for group, entries in GROUPS.items()
    for name, entry in entries.items()
}


def spell(entry):
    """Return the text of an entry of `ENTRIES`."""
    parts = {
        "BOX": entry.get("box", json.dumps(BOX)),
        "ROD": entry.get("rod", json.dumps(ROD)),
        "STEP": entry.get("step", json.dumps(STEP)),
        "LAST": entry.get("last", json.dumps(LAST)),
    }
    for name in ("BOX", "ROD"):
        parts[f"ESCAPED_{name}"] = json.dumps(parts[name])[1:-1]
    tool = entry.get("tool", '"tool_components": [BOX, ROD]')
    plan = entry.get("plan", "[STEP, LAST]")
    plans = entry.get("plans", f"[{plan}]")
    strategy = f'{{"strategy_name": "s", {tool}, "action_sets": {plans}}}'
    strategy = _put(strategy, parts)
    document = f'{{"strategies": [{strategy}]}}'
    fenced = json.dumps(f"Here it is:\n```json\n{document}\n```\nGood luck.")[1:-1]
    middle = fenced.index("strategies")
    texts = {
        "DOC": document,
        "SECOND": replaced_all(document, ('"s"', '"t"')),
        "THIRD": replaced_all(document, ('"s"', '"u"')),
        "FENCED_A": fenced[:middle],
        "FENCED_B": fenced[middle:],
        "FENCED": fenced,
    }
    return _put(entry.get("reply", "DOC"), texts)


def _put(text, parts):
    """Put the parts in the places of their names."""
    names = sorted(parts, key=len, reverse=True)
    return re.sub("|".join(names), lambda name: parts[name[0]], text)


def read(text):
    """Read a reply as the designer does; return its candidates and all reasons."""
    tools = installed().create("tool", "boxes")
    actions = installed().create("action", "anchored", guards=True)
    try:
        document = parse_reply(text)
        found = read_designs(document, tools, bring_cube(), actions=actions)
    except DesignError as error:
        return [], [str(error)]
    return found, [candidate.problem for candidate in found if candidate.problem]


def shown(candidate):
    """Return the tool without its colours, and the plan."""
    parts = [
        (c.name, c.parent, c.shape, c.pose, c.mass) for c in candidate.tool.components
    ]
    return parts, candidate.plan


@pytest.mark.parametrize("name", ENTRIES)
def test_a_spelling_is_read_as_the_sound_design_or_refused(name):
    entry = ENTRIES[name]
    (sound,), reasons = read(spell({}))
    assert not reasons

    found, reasons = read(spell(entry))

    if "fault" in entry:
        assert entry["fault"] in " ".join(reasons)
        assert all(candidate.problem for candidate in found)
        return

    assert not reasons
    assert len(found) == entry.get("n", 1)
    for candidate in found:
        parts, plan = shown(candidate)
        sound_parts, sound_plan = shown(sound)
        if entry.get("near"):
            rows = [step.offset for step in plan.steps]
            wanted = [step.offset for step in sound_plan.steps]
            np.testing.assert_allclose(rows, wanted, atol=1e-12)
        else:
            assert plan == sound_plan
        if entry.get("renamed"):
            assert [part[2:] for part in parts] == [part[2:] for part in sound_parts]
        else:
            assert parts == sound_parts
