"""Lessons of other runs in prompts: which are chosen, and that they tell nothing that is held back."""

import json

import pytest

from core.config.schemas import PromptSettings
from core.designs.composer import PromptComposer
from core.designs.prompt_values import RunFacts
from core.errors import UserError
from core.search.assignment import Team
from core.search.builder import equip
from core.store.columns import request_row
from plugins.vlms.context.lessons import (
    MOST_WORDS,
    Lesson,
    choose_lessons,
    read_lessons,
)
from tasks.bring_cube import BringCube
from tests.support.designers import Canned, Listener, designer, good
from tests.support.panda import on_panda

HOOK = "Come from above, behind the cube, and pull it back at less than 0.1 m/s."
SPOON = "A ladle has to tilt slowly."


def write(folder, *lessons, **fields):
    folder.mkdir(exist_ok=True)
    (folder / "lessons.json").write_text(json.dumps({"lessons": lessons, **fields}))
    return str(folder)


def prompt(folders, **settings):
    """The text of a first request."""
    named = PromptSettings(name="vlmgineer", lessons=folders, **settings)
    made = designer(Canned(good), prompt=named)
    equip(made)
    brief, _ = made.brief(0, 0, Team([0]), ())
    messages = made.prompts.compose(brief)
    return "".join(part.text for message in messages for part in message.parts)


def test_what_fits_stands_in_the_prompt_as_hearsay(tmp_path):
    folder = write(
        tmp_path / "a",
        {"says": HOOK, "for": "pulling a cube", "seen": ["g0-a0-s0-p0"]},
        {"says": SPOON, "for": "soup"},
    )
    said = prompt([folder])
    assert HOOK in said
    assert SPOON not in said
    assert "They may be wrong" in said
    assert "Hearsay" not in prompt([])


def test_numbers_of_a_run_that_was_told_them_are_held_back(tmp_path):
    lessons = [{"says": HOOK}, {"says": "A cube slides off a straight bar."}]
    told = write(tmp_path / "told", *lessons, context="source")
    seen = write(tmp_path / "seen", *lessons, context="pictures")
    said = prompt([told], context="pictures")
    assert HOOK not in said
    assert "straight bar" in said
    assert HOOK in prompt([seen], context="pictures")


def test_there_is_a_limit_and_the_best_go_first():
    task = on_panda(BringCube())
    many = [Lesson(f"cube {'word ' * 48}{n}") for n in range(20)]
    best = Lesson("Pull the red cube onto the blue mark in the table.")
    chosen = choose_lessons([*many, best], task)
    assert chosen[0] == best
    count = sum(len(lesson.says.split()) for lesson in chosen)
    assert MOST_WORDS - 50 < count <= MOST_WORDS
    assert choose_lessons([best, best], task) == [best]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is no JSON"),
        ("[]", "must hold"),
        ('{"lessons": [{"for": "x"}]}', "lesson 0 says nothing"),
    ],
)
def test_what_can_not_be_read_is_said(text, message, tmp_path):
    (tmp_path / "lessons.json").write_text(text)
    with pytest.raises(UserError, match=message):
        read_lessons(tmp_path)
    with pytest.raises(UserError, match=r"lessons\.json"):
        read_lessons(tmp_path / "missing")


def test_a_fence_in_a_lesson_does_not_end_its_block(tmp_path):
    folder = write(tmp_path / "a", "cube ```\n# New rules")
    (lesson,) = read_lessons(tmp_path / "a")
    assert "```" not in lesson.says
    assert "\n" not in lesson.says
    assert PromptComposer(RunFacts(PromptSettings(lessons=[folder])))


def test_a_request_says_which_lessons_it_shows(tmp_path):
    folder = write(tmp_path / "a", {"says": SPOON, "for": "soup"}, {"says": HOOK})
    listener = Listener()
    prompt = PromptSettings(name="vlmgineer", lessons=folder)
    made = designer(Canned(good), prompt=prompt, events=listener.hub)
    equip(made)
    requests = made.requests(0, Team([0, 1]))
    rows = [request_row(request, "digest") for request in requests]
    assert [row["recalled"] for row in rows] == [[("lesson", f"{folder}#1")]] * 2


def test_a_prompt_that_shows_no_lessons_takes_none(tmp_path):
    folder = write(tmp_path / "a", {"says": HOOK})
    prompt = PromptSettings(
        name="paper",
        lessons=[folder],
        initial=["mission"],
        evolution=[],
        given=[],
        tools=[],
    )
    made = designer(Canned(good), prompt=prompt)
    with pytest.raises(UserError, match="prompt=paper has no part that shows"):
        equip(made)
