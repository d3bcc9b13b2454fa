"""What is taken from a stored configuration, and what has to be typed again."""

import shlex
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from core.config.compose import load
from core.config.gate import find_strange, note_typed, take_stored
from core.errors import UserError
from core.plugins import KINDS, installed
from core.plugins.outside import is_outside
from core.plugins.registry import hints_of, settings_of

pytestmark = pytest.mark.slow
FOLDER = Path("runs/theirs")


@pytest.fixture(autouse=True)
def another_user(tmp_path, monkeypatch):
    """Nobody has typed anything on this machine."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def stored(*words):
    return OmegaConf.to_container(load("config", words), resolve=True)


HARMLESS = [
    [],
    ["vlm=gemini", "prompt=paper", "protocol=varied", "budget=paper"],
    ["vlm=ensemble", "vlm.members=[gemini,{name: openai, timeout_s: 5}]"],
    ["evolution=map_elites", "protocol=lean", "material=pla", "vlm=mailbox"],
    ["fitness=robust", "fitness.sims=[mujoco,{name: sapien}]", "task.variation=wide"],
    ["task=multitask", "task.of=[BringCube,{name: OneBook, variation: wide}]"],
    [
        "evolution=islands",
        "evolution.styles=[a tool of few parts]",
        "evolution.refine=8",
    ],
]


@pytest.mark.parametrize("words", HARMLESS)
def test_numbers_and_what_types_speak_for_is_taken(words):
    config = stored(*words)
    assert take_stored(config, FOLDER, []) == (config, [])


OUTSIDE = {
    "a program": (
        ["vlm=command", "vlm.command=[sh,-c,'id > /tmp/x']"],
        ["vlm.command"],
    ),
    "its environment": (
        ["vlm=command", "vlm.environment=[OPENAI_API_KEY]"],
        ["vlm.environment"],
    ),
    "a program of a member": (
        ["vlm=ensemble", "vlm.members=[gemini,{name: command, command: [sh]}]"],
        ["vlm.members"],
    ),
    "an address": (["vlm=gemini", "vlm.api_base=http://a.example"], ["vlm.api_base"]),
    "a model that is paid": (["vlm=gemini", "vlm.model=zai/glm-4.6"], ["vlm.model"]),
    "an address in options": (
        ["vlm=openai", "vlm.options={base_url: http://a.example}"],
        ["vlm.options"],
    ),
    "machines": (
        ["executor=ray", "executor.address=10.0.0.1:6379"],
        ["executor.address"],
    ),
    "a scene file": (["task=file", "task.file=/etc/passwd"], ["task.file"]),
    "a scene file among tasks": (
        ["task=multitask", "task.of=[BringCube,{name: file, file: /etc/passwd}]"],
        ["task.of"],
    ),
    "an arm's file": (
        ["robot=urdf", "robot.path=/etc/passwd", "robot.flange=tool0"],
        ["robot.path"],
    ),
    "a designs file and a library": (
        ["tool=known", "tool.file=/etc/passwd", "tool.library=/etc"],
        ["tool.file", "tool.library"],
    ),
    "what prompts show": (
        ["prompt.file=/etc/passwd", "prompt.lessons=[/etc]", "prompt.examples=[/etc]"],
        ["prompt.file", "prompt.lessons", "prompt.examples"],
    ),
    "templates": (["prompt.dir=/etc"], ["prompt.dir"]),
    "replies": (["vlm=replay", "vlm.run=/etc"], ["vlm.run"]),
}


@pytest.mark.parametrize(("words", "names"), OUTSIDE.values(), ids=OUTSIDE)
def test_what_may_lead_out_is_typed_again_by_the_words_that_the_error_says(
    words, names
):
    config = stored(*words)
    assert {found.path for found in find_strange(config)} == set(names)
    with pytest.raises(
        UserError, match="was not begun by you on this machine"
    ) as error:
        take_stored(config, FOLDER, ["budget.n_iteration=9"])

    again = shlex.split(str(error.value).partition("type it again: ")[2])
    assert len(again) == len(names)
    taken, left = take_stored(config, FOLDER, [*again, "budget.n_iteration=9"])
    assert (taken, left) == (config, ["budget.n_iteration=9"])
    with pytest.raises(UserError):
        take_stored(config, FOLDER, again[1:])


def test_what_is_typed_again_may_lie_elsewhere_here():
    config = stored("robot=urdf", "robot.path=/their/arm.urdf")
    taken, left = take_stored(config, FOLDER, ["robot.path=/my/arm.urdf"])
    assert taken["robot"]["path"] == "/my/arm.urdf"
    assert left == []


def test_only_what_is_used_is_asked_for():
    config = stored("vlm=command", "vlm.command=[sh]", "seed=3")
    words = ["seed=3", "film=true"]
    assert take_stored(config, FOLDER, words, ["task", "tool"]) == (config, words)
    with pytest.raises(UserError, match=r"type it again: 'vlm\.command=\[sh\]'"):
        take_stored(config, FOLDER, [], ["vlm"])


def test_a_command_without_words_for_it_names_the_one_that_has_them():
    config = stored("task=file", "task.file=a scene.yaml")
    with pytest.raises(
        UserError, match=r"vlmgineer inspect runs/theirs 'task\.file="
    ) as error:
        take_stored(config, FOLDER)
    assert "a scene.yaml" in str(error.value)


def test_what_this_user_typed_here_is_used_again(tmp_path):
    config = stored("vlm=command", "vlm.command=[sh]")
    note_typed(config)
    assert take_stored(config, FOLDER, []) == (config, [])
    note_typed(config)
    (noted,) = (tmp_path / "state").rglob("configurations")
    assert len(noted.read_text().splitlines()) == 1
    assert noted.stat().st_mode & 0o077 == 0

    # A stranger's changes another setting, such as the task in which the program is used.
    with pytest.raises(UserError, match="was not begun by you"):
        take_stored(config | {"seed": 7}, FOLDER, [])


def test_nothing_is_noted_of_what_is_harmless(tmp_path):
    note_typed(stored("vlm=gemini"))
    assert not (tmp_path / "state").exists()


def test_where_nothing_can_be_noted_it_is_asked_for(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    config = stored("vlm=command", "vlm.command=[sh]")
    note_typed(config)
    with pytest.raises(UserError, match="was not begun by you"):
        take_stored(config, FOLDER, [])


def test_no_key_is_typed_again():
    config = stored("vlm=gemini")
    with pytest.raises(UserError, match="is a key or holds one"):
        take_stored(config, FOLDER, ["vlm.api_key=sk-anything"])


def test_every_text_of_a_built_in_part_was_thought_of():
    """A new setting of text is typed again, unless its type says that it is harmless."""
    found = set()
    for kind, name in installed().offers:
        if kind not in KINDS or kind == "command":
            continue
        factory = installed().factory(kind, name)
        hints = hints_of(factory)
        for setting in settings_of(factory, KINDS[kind].provided):
            if "str" in str(hints[setting]) and is_outside(["a text"], hints[setting]):
                found.add(f"{kind}.{setting}")

    assert found == EXPECTED - {"robot.path"}  # which is no text, but a path


EXPECTED = {
    "executor.address",
    "fitness.references",
    "robot.path",
    "task.file",
    "tool.file",
    "tool.library",
    "vlm.api_base",
    "vlm.command",
    "vlm.environment",
    "vlm.folder",
    "vlm.model",
    "vlm.options",
    "vlm.run",
}
