"""One fault each in replies as different models write them: what is read, and what a second look mends."""

import json
import re

import pytest

from core.config.schemas import PromptSettings
from core.interfaces import Budget, Reply
from tests.support.designers import Canned, designer
from tests.support.spelled import RAW, read, spell
from tests.support.text import replaced_all

pytestmark = pytest.mark.slow

DOC = spell({"reply": "DOC"})
TURN = "1.5707963267948966"
LINK = '<link name=\\"rod\\">'


def swap(old, new):
    """Make the sound reply with one piece replaced by another."""
    return replaced_all(DOC, (old, new))


def strategy(**changes):
    """Make the sound reply with other fields; None leaves one out."""
    fields = {**json.loads(DOC)["strategies"][0], **changes}
    return json.dumps({"strategies": [{k: v for k, v in fields.items() if v != ""}]})


PLANS = json.loads(DOC)["strategies"][0]["action_sets"]
# What has one meaning: it is read.
READ = {
    "a fence": f"Here you are:\n```json\n{DOC}\n```",
    "a thought": f"<think>A rod, {{perhaps}}.</think>{DOC}",
    "a bare list": DOC[len('{"strategies": ') : -1],
    "another envelope": f'{{"result": {{"output": {DOC}}}}}',
    "a tool call": json.dumps({"name": "answer", "arguments": DOC}),
    "content parts": json.dumps([{"type": "text", "text": DOC}]),
    "a list in a text": strategy(action_sets=json.dumps(PLANS)),
    "Python": str(json.loads(DOC)),
    "a remark": swap('"tool_urdf"', '// 1 rod\n"tool_urdf"'),
    "a last comma": DOC[:-2] + ",]}",
    "a missing end": DOC[:-2],
    "unescaped quotes": DOC.replace('\\"', '"'),
    "curly quotes": swap('"tool_urdf"', "“tool_urdf”"),
    "curly quotes around escaped ones": re.sub(
        r'"((?:[^"\\]|\\.)*)"(?=[,:\]}])', r"“\1”", DOC
    ),
    "underscores that Markdown escapes": DOC.replace("_", r"\_"),
    "a draft in an analysis channel": (
        f"<|channel|>analysis<|message|>{swap('0.62', '0.55')}<|end|>"
        f"<|start|>assistant<|channel|>final<|message|>{DOC}<|return|>"
    ),
    "an analysis without a draft": f"<|channel|>analysis<|message|>{DOC}",
    "unquoted keys": re.sub(r'"(\w+)":', r"\1:", DOC),
    "a sum": swap("0.62", "0.5 + 0.12"),
    "a unit": swap("0.62", "62 cm"),
    "pi": swap(TURN, "pi/2"),
    "degrees that say so": swap(TURN, '"90 deg"'),
    "a wide minus": swap("-0.25", "\u22120.25"),
    "a long dash": swap("-0.25", "\u20130.25"),
    "numbers as texts": strategy(
        action_sets=json.loads(re.sub(r"(-?\d[\d.]*)", r'"\1"', json.dumps(PLANS)))
    ),
    "one plan": strategy(action_sets=PLANS[0]),
    "plans in objects": strategy(action_sets=[{"waypoints": PLANS[0]}]),
    "numbered plans": strategy(action_sets={"plan_1": PLANS[0]}),
    "a grip too many": strategy(action_sets=[[[*pose, 0] for pose in PLANS[0]]]),
    "camel case": swap("tool_urdf", "toolUrdf"),
    "a shorter name": swap("tool_urdf", "urdf"),
    "another name of plans": swap(
        "action_sets", replaced_all("trajectories", ("ies", "y"))
    ),
    "lines": strategy(tool_urdf=RAW.replace("><", ">\n<").splitlines()),
    "HTML": strategy(tool_urdf=RAW.replace("<", "&lt;").replace(">", "&gt;")),
    "a robot around it": strategy(tool_urdf=f"<robot>{RAW}</robot>"),
    "a described gripper": strategy(gripper="none"),
    "a description in a list": strategy(tool_description=["a rod", "10 cm"]),
}
# What breaks a rule, or has two meanings: it goes back once.
MENDED = {
    "a gap of 3 cm": (swap("0 0 -0.055", "0 0 -0.085"), "move it by"),
    "too long for the start": (swap("0.02 0.02 0.1", "0.02 0.02 0.9"), "mm inside"),
    "too heavy": (
        swap(LINK, LINK + '<inertial><mass value=\\"9\\"/></inertial>'),
        "kg",
    ),
    "a far waypoint": (swap("0.62", "6.2"), "x is 6.2"),
    "bare degrees": (swap(TURN, "90"), "90 degrees are 1.5708"),
    "a number or two": (swap("0.62, -0.25", "0.62 -0.25"), "malformed"),
    "a number left out": (swap("0.62, ", ""), "has 5 numbers"),
    "a waypoint left out": (
        swap("], [0.62", "], ..., [0.62"),
        "write out every waypoint",
    ),
    "a near name": (swap("tool_urdf", "tool_udrf"), "did you mean"),
    "no tool": (strategy(tool_urdf=""), "tool_urdf is missing"),
    "no plan": (strategy(action_sets=""), "missing or empty"),
    "an unknown parent": (swap('link=\\"tool_mount', 'link=\\"wrist'), "wrist"),
    "a cut reply": (DOC[:-60], "malformed"),
    "a refusal": ("I can't help with that.", "no JSON object"),
}


def ask(*texts):
    """Have a model answer with the texts in turn; return the candidates, and how often it was asked."""
    turn = iter(texts)
    vlm = Canned(lambda request: Reply(request.id, next(turn), "a can"))
    settings = PromptSettings(repair=1)
    asked = designer(vlm, Budget(1, 1, 1, 0, 5, 0.6), prompt=settings)
    return list(asked.design(0)), len(vlm.requests)


@pytest.mark.parametrize("name", READ)
def test_what_has_one_meaning_is_used_at_once(name):
    (sound,), _ = read(DOC)
    (found,), calls = ask(READ[name])
    assert found.problem is None
    assert found.content == sound.content
    assert calls == 1


@pytest.mark.parametrize("name", MENDED)
def test_what_breaks_a_rule_is_mended_by_a_second_look(name):
    text, fault = MENDED[name]
    (sound,), _ = read(DOC)
    _, reasons = read(text)
    (found,), calls = ask(text, DOC)
    if not reasons:  # of the start, which is looked at with a second look
        reasons = [ask(text, text)[0][0].problem]
    assert fault in " ".join(reasons)
    assert found.problem is None
    assert found.content == sound.content
    assert calls == 2
