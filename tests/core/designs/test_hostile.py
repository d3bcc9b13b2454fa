"""Hostile replies, each read in a process with limited time and memory, and random ones."""

import contextlib
import json
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.design import DesignError
from core.designs.reading import read_designs
from core.designs.replies import parse_reply
from core.designs.rules import MAX_COMPONENTS
from core.plugins import installed
from tests.conftest import FUZZ_CASES
from tests.support.hostile import (
    REPLIES,
    ROD,
    TOOLS,
    boxes,
    bring_cube,
    frames,
    reply,
    reply_of,
    sound,
    tool_reply,
)
from tests.support.rare import mostly
from tests.support.soundness import check_candidate
from tests.support.text import replaced_all

pytestmark = pytest.mark.slow

URDF = installed().create("tool", "urdf")
LIMITS = {"workers": 1, "timeout_s": 60.0, "memory_mb": 1024}
NAMES = [*(f"tool: {key}" for key in TOOLS), *(f"reply: {key}" for key in REPLIES)]
# What is hostile in them is dropped, what is left is sound.
HARMLESS = {"texture", "stylesheet", "million plans"}


def reading(text):
    """Read a reply as `core.search.designer` does."""
    return read_designs(parse_reply(text), URDF, bring_cube(), most=(10, 10))


def problems(names):
    """Runs in a worker: the problem of each candidate of a hostile reply; a string if there are no candidates."""
    (name,) = names
    group, _, key = name.partition(": ")
    try:
        candidates = reading(tool_reply(key) if group == "tool" else reply(key))
    except DesignError as error:
        return str(error)
    for candidate in candidates:
        check_candidate(candidate)
    return [candidate.problem for candidate in candidates]


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    with contextlib.chdir(tmp_path_factory.mktemp("cwd")):
        with installed().create("executor", "local", LIMITS) as pool:
            ((_, found),) = pool.map(problems, [["reply: a refusal"]])
            assert "no JSON object" in found
            yield pool
        assert list(Path.cwd().iterdir()) == []


@pytest.mark.parametrize("name", mostly(NAMES, "reply: million plans"))
def test_is_refused_with_a_reason(pool, name):
    ((_, found),) = pool.map(problems, [[name]])
    assert not isinstance(found, Exception), found
    if name.partition(": ")[2] in HARMLESS:
        assert set(found) == {None}
        return
    assert found
    for reason in [found] if isinstance(found, str) else found:
        assert reason
        assert reason.isprintable()
        assert len(reason) < 500


WORST = {  # of what a megabyte may hold
    "link of a thousand boxes": TOOLS["link of a thousand boxes"],
    "chain of frames": TOOLS["chain of frames behind many boxes"],
    "split number": TOOLS["number that can be split in many ways"],
    "boxes that touch one other": boxes(MAX_COMPONENTS),
    "boxes at one place": boxes(MAX_COMPONENTS, 0.0),
    "as many frames as are allowed": boxes(MAX_COMPONENTS, 0.0) + frames(99, "b"),
}


@pytest.mark.parametrize("text", WORST.values(), ids=WORST)
def test_the_worst_tools_are_read_in_two_seconds(text):
    reading(reply_of(sound()))
    began = time.process_time()
    reading(reply_of(sound(tool_urdf=text)))
    # On a machine three times as slow as any of this decade.
    assert time.process_time() - began < 3 * 2.0


@pytest.mark.weekly
def test_strategies_inside_each_other_are_read_a_few_times_at_most():
    """Each of them is malformed only at the end of the reply; the decoder's time counts."""
    flat = '{"strategies":[{"parents":0,"a":[' + "[]," * 600_000
    nested = '{"strategies":[' + '{"parents":0,"a":[' * 90 + "[]," * 600_000

    def taken(text):
        began = time.process_time()
        with pytest.raises(DesignError):
            parse_reply(text + "x")
        return time.process_time() - began

    taken(flat)
    assert taken(nested) < 10 * taken(flat)  # 90 times without a limit


def test_a_sound_reply_is_accepted():
    (candidate,) = reading(reply_of(sound()))
    assert candidate.problem is None
    check_candidate(candidate)


@pytest.mark.parametrize("name", sorted(HARMLESS & set(TOOLS)))
def test_references_are_dropped(name):
    (candidate,) = reading(tool_reply(name))
    written = json.dumps(URDF.dump(candidate.tool))
    assert "passwd" not in written
    assert "127.0.0.1" not in written


def test_names_reach_no_path():
    """Valid names of links hold no path separator."""
    for name in ("..", ".", "-rf", "a" * 64):
        tool = URDF.parse(
            sound(tool_urdf=replaced_all(ROD, ('"rod"', f'"{name}"'))), gripper=False
        )
        assert tool.components[0].name == name
    with pytest.raises(DesignError):
        URDF.parse(
            sound(tool_urdf=replaced_all(ROD, ('"rod"', '"a/b"'))), gripper=False
        )


# --- random ones ------------------------------------------------------------------------------------------------

fuzz = settings(
    max_examples=FUZZ_CASES, suppress_health_check=list(HealthCheck), print_blob=True
)

WORDS = (
    "rod|b|panda_virtual|panda_link7||fixed|0.02 0.02 0.1|0 0 -0.055|nan|1e9|-1|../x|0 0 0|0.1|1e-9 1 1|\x1b[2J|&amp;|"
    "\ud800|\u202e|0.03 0.03 0.03|0.02|1 0 0 1"
)
TAGS = (
    "link joint visual collision inertial geometry box mesh origin mass parent child material color texture robot "
    "gazebo sphere"
)
words, tags = st.sampled_from(WORDS.split("|")), st.sampled_from(TAGS.split())
attributes = st.dictionaries(
    st.sampled_from(
        ["name", "type", "link", "size", "xyz", "rpy", "value", "rgba", "filename"]
    ),
    words,
    max_size=3,
)


def written(tag, given, inside):
    return f"<{' '.join([tag, *(f'{key}={value!r}' for key, value in given.items())])}>{''.join(inside)}</{tag}>"


def element(children):
    return st.builds(written, tags, attributes, st.lists(children, max_size=4))


xml = st.recursive(
    st.one_of(words, st.builds("<{}/>".format, tags)), element, max_leaves=12
)


@st.composite
def urdf(draw):
    """A sound tool among elements at random, changed in a few places; now and then as it stands."""
    others = draw(st.one_of(st.just([]), st.lists(xml, max_size=3)))
    text = "".join(draw(st.permutations([ROD, *others])))
    for _ in range(draw(st.sampled_from([0, 0, 1, 2, 4]))):
        at = draw(st.integers(0, len(text)))
        end = draw(st.integers(at, min(len(text), at + 30)))
        text = (
            text[:at]
            + draw(
                st.one_of(words, xml, st.text(max_size=5), st.just(text[at:end] * 2))
            )
            + text[end:]
        )
    old = draw(
        st.sampled_from(
            [
                "0.02 0.02 0.1",
                "rod",
                "panda_virtual",
                "0 0 -0.055",
                'value="0.02"',
                "fixed",
            ]
        )
    )
    return text.replace(old, draw(words)) if draw(st.booleans()) else text


def test_any_tool_is_sound_or_refused():
    sound_ones = 0

    @fuzz
    @given(text=urdf(), gripper=st.booleans())
    def check(text, gripper):
        nonlocal sound_ones
        for candidate in reading(reply_of(sound(tool_urdf=text, gripper=gripper))):
            check_candidate(candidate)
            if candidate.problem is None:
                sound_ones += 1
                again = URDF.parse(URDF.dump(candidate.tool), gripper=gripper)
                assert len(again.components) == len(candidate.tool.components)

    check()
    assert sound_ones >= FUZZ_CASES // 50  # one in ten is


numbers = st.one_of(
    st.floats(),
    st.integers(),
    st.floats(-1, 1),
    st.sampled_from(["0.5", "NaN", "1e999", None, True]),
)
waypoints = st.lists(st.one_of(numbers, st.floats(0.3, 0.6)), min_size=5, max_size=8)
anything = st.recursive(
    st.one_of(st.none(), st.booleans(), numbers, st.text(max_size=20)),
    lambda inside: st.one_of(
        st.lists(inside, max_size=4),
        st.dictionaries(st.text(max_size=9), inside, max_size=4),
    ),
    max_leaves=8,
)
strategies = st.builds(
    lambda changes, dropped: {
        k: v for k, v in sound(**changes).items() if k not in dropped
    },
    st.fixed_dictionaries(
        {},
        optional={
            "gripper": st.one_of(st.booleans(), anything),
            "tool_urdf": st.one_of(st.just(ROD), urdf(), anything),
            "action_sets": st.one_of(
                st.lists(st.lists(waypoints, max_size=3), max_size=3), anything
            ),
            "strategy_name": st.one_of(st.text(), anything),
            "tool_description": st.one_of(st.text(), anything),
            "parents": anything,
        },
    ),
    st.sets(st.sampled_from(["gripper", "tool_urdf", "action_sets"]), max_size=1),
)


@st.composite
def replies(draw):
    """A document with or without text around it, complete or not."""
    some = st.one_of(st.just(sound()), strategies, anything)
    text = json.dumps({"strategies": draw(st.lists(some, min_size=1, max_size=3))})
    text = draw(st.text(max_size=10)) + text + draw(st.text(max_size=10))
    for _ in range(draw(st.sampled_from([0, 0, 1, 3]))):
        at = draw(st.integers(0, len(text)))
        end = draw(st.integers(at, min(len(text), at + 20)))
        text = (
            text[:at]
            + draw(
                st.sampled_from(
                    ["", "{", "}", "[", "]", '"', ",", "//", "/*", "\\", "\ud800"]
                )
            )
            + text[end:]
        )
    return (
        text[: draw(st.integers(0, len(text)))]
        if draw(st.sampled_from([False, False, True]))
        else text
    )


def test_any_reply_gives_sound_candidates_or_a_reason():
    sound_ones = 0

    @fuzz
    @given(replies())
    def check(text):
        nonlocal sound_ones
        try:
            candidates = reading(text)
        except DesignError:
            return
        for candidate in candidates:
            check_candidate(candidate)
            sound_ones += candidate.problem is None

    check()
    assert sound_ones >= FUZZ_CASES // 10  # one in two has some
