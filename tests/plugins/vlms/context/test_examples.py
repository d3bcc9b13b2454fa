"""Winners of other runs in prompts: which are chosen, and that they tell nothing that is held back."""

import pytest

from core.config.schemas import PromptSettings
from core.errors import UserError
from core.search.assignment import Team
from core.search.builder import equip
from tests.core.run_folders import hook, write_run
from tests.support.designers import Canned, designer, good


def ask(examples, **settings):
    """A first request, and its text."""
    prompt = PromptSettings(name="vlmgineer", examples=examples, **settings)
    made = designer(Canned(good), prompt=prompt)
    equip(made)
    (request,) = made.requests(0, Team([0]))
    parts = [part for message in request.messages for part in message.parts]
    return request, "".join(part.text for part in parts)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    told = {}
    for name, task, level, reward in (
        ("cube", "BringCube", "source", 0.7),
        ("better", "BringCube", "source", 0.9),
        ("ball", "MoveBall", "source", 0.8),
        ("plate", "ElevatePlate", "source", 0.6),
        ("seen", "MoveBall", "pictures", 0.5),
    ):
        tool = hook(0.2, f"tool of {name}", "It ends a block: ```")
        words = [f"task={task}", f"prompt.context={level}"]
        write_run(root / name, *words, rewards=[[0.1, reward]], tools=[tool])
        told[name] = str(root / name)
    return told


def test_winners_of_two_tasks_stand_in_the_prompt(runs):
    request, said = ask([runs["cube"], runs["better"], runs["ball"], runs["plate"]])
    shown = [recalled.source for recalled in request.brief.recalled]
    assert len(shown) == 2
    assert shown[0] == f"{runs['better']}#g0-a0-s1-p0"
    assert "tool of better" in said
    assert "tool of cube" not in said
    block = said.partition("## Examples from elsewhere")[2].partition("```json")[2]
    assert block.index("\n```") > block.index("action_plan")
    assert "Examples from elsewhere" not in ask([])[1]


def test_numbers_of_a_run_that_was_told_them_are_held_back(runs):
    said = ask([runs["ball"]], context="pictures")[1]
    assert "tool of ball" not in said
    assert "tool of seen" in ask([runs["seen"]], context="pictures")[1]


def test_what_can_not_be_read_is_said(runs, tmp_path):
    with pytest.raises(UserError, match=r"prompt\.examples: .*missing"):
        ask([str(tmp_path / "missing")])
    write_run(tmp_path / "open", "task=MoveBall", finish=False)
    write_run.open.pop().hook.run_ended()
    with pytest.raises(UserError, match="no best candidate; give a finished one"):
        ask([str(tmp_path / "open")])
