"""What was sound stays the same or is refused: no mutation of a reply's syntax makes another number of it."""

import json
import random

import numpy as np
import pytest

from core.design import DesignError
from core.designs.reading import read_designs
from core.designs.replies import parse_reply
from core.plugins import installed
from plugins.actions.waypoints import WaypointActions
from tests.support.hostile import bring_cube
from tests.support.spelled import POSES, RAW

PLANS = [POSES, [[*pose[:5], 0.25] for pose in POSES]]
STRATEGIES = [
    {"strategy_name": name, "tool_urdf": RAW, "action_sets": PLANS} for name in "ab"
]
TEXT = json.dumps({"strategies": STRATEGIES})
MARKS = [
    *list("\"'“”`{}[](),:;#/\\\n "),
    "//",
    "/*",
    "*/",
    "...",
    "\xa0",
    '\\"',
    "```",
    "«",
    "’",
]
# Digits and what belongs to numbers stay: other digits would be another sound number.
IN_NUMBERS = set("0123456789.-+eE")


def mutate(text, rng):
    """Delete, insert, double or swap a few marks of the syntax."""
    for _ in range(rng.choice([1, 1, 2, 3])):
        place = rng.randrange(len(text))
        while text[place] in IN_NUMBERS or text[place].isalpha():
            place = rng.randrange(len(text))
        mark = text[place]
        marks = MARKS
        if text.rfind("<link", 0, place) > text.rfind("</joint>", 0, place):
            if mark not in '"\\':  # the URDF itself is not the reader's
                continue
            marks = ['"', "'", "\\"]
        new = rng.choice(["", mark + rng.choice(marks), mark * 2, rng.choice(marks)])
        text = text[:place] + new + text[place + 1 :]
    return text


def is_json(text):
    try:
        json.loads(text, strict=False)
    except ValueError:
        return False
    return True


def check(count, seed):
    """Return how many mutated replies were read whole, in part, and not at all."""
    rng = random.Random(seed)
    tools = installed().create("tool", "urdf")
    document = parse_reply(TEXT)
    sound = read_designs(document, tools, bring_cube(), actions=WaypointActions())
    assert all(candidate.problem is None for candidate in sound)
    tool = sound[0].tool.content
    figures = {"whole": 0, "part": 0, "none": 0, "valid": 0}

    for _ in range(count):
        text = mutate(TEXT, rng)
        if is_json(text):  # what the model wrote then, and nobody can know better
            figures["valid"] += 1
            continue
        try:
            found = read_designs(
                parse_reply(text), tools, bring_cube(), actions=WaypointActions()
            )
        except DesignError:
            found = []
        good = [candidate for candidate in found if candidate.problem is None]
        for candidate in good:
            assert candidate.tool.content == tool, text
            poses = candidate.plan.poses
            assert any(
                np.array_equal(poses, np.array(plan, float)) for plan in PLANS
            ), (text, poses)
        key = "whole" if len(good) == len(sound) else "part" if good else "none"
        figures[key] += 1
    return figures


def test_a_few_hundred_mutations():
    figures = check(300, seed=1)
    assert figures["whole"] > 30
    assert figures["part"] > 60


@pytest.mark.weekly
@pytest.mark.slow
def test_ten_thousand_mutations():
    figures = check(10_000, seed=2)
    assert figures["whole"] > 1000
