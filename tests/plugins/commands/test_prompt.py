"""``vlmgineer prompt``: what would be sent, in every use."""

import json
import re
from pathlib import Path

import pytest

from core.config.compose import load
from core.designs.composer import as_markdown
from core.errors import UserError
from core.interfaces import VLM, Picture
from core.plugins import Offer, installed
from plugins.commands.prompt import PromptConfig, compose, main
from tests.support.commands import python_m
from tests.support.rare import rare

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
SOLUTION = ROOT / "tests/tasks/solutions/OneBook.json"
SMALL = ["task=OneBook", "sim=mujoco", "executor.workers=1"]


def composed(*overrides):
    return compose(load("prompt", [*SMALL, *overrides], PromptConfig))


def text_of(request):
    return "".join(as_markdown(message) for message in request.messages)


@pytest.fixture(scope="module")
def designs(tmp_path_factory):
    """Three tools: one that does nothing, one with a poor and a good plan, and one that can't be read."""
    (good,) = json.loads(SOLUTION.read_text())["strategies"]
    idle = [[0.5, 0, 0.5, 0, 0, 0]]
    document = [good | {"action_sets": [idle], "tool_name": "idle"}]
    document += [
        good | {"action_sets": [idle, *good["action_sets"]], "tool_name": "good"}
    ]
    document += [good | {"tool_urdf": "<link/>", "tool_name": "broken"}]
    file = tmp_path_factory.mktemp("designs") / "designs.json"
    file.write_text(json.dumps({"strategies": document}))
    return file


@pytest.fixture
def idea(tmp_path):
    file = tmp_path / "idea.md"
    file.write_text("Use a long hook.")
    return f"prompt.file={file}"


USES = {
    "first sampling": ([], "Invent", "takes the place of the gripper", 6),
    "first sampling, gripper": (
        ["task.tool_kinds=[gripper]"],
        "Invent",
        "a pair of attachments to the gripper's fingers",
        7,
    ),
    "no tool": (
        ["tool=none"],
        "nothing but its two-finger gripper",
        "not the fingers",
        7,
    ),
    "given tool": (
        ["task=BringCube", "tool=rlbench"],
        "The tool, stick",
        "can't be changed. Each part",
        6,
    ),
    "human": (
        ["prompt=human"],
        "Use a long hook.",
        "takes the place of the gripper",
        6,
    ),
}


@pytest.mark.parametrize("use", USES)
def test_every_use(use, idea):
    overrides, mission, robot, numbers = USES[use]
    request = composed(*overrides, *([idea] if use == "human" else []))
    text = text_of(request)
    assert mission in text
    assert robot in text
    assert f"exactly {numbers} numbers" in text
    assert "class " in text
    assert request.id == "g0-a0"
    plan = request.schema["properties"]["strategies"]["items"]["properties"][
        "action_sets"
    ]["items"]
    assert plan["items"]["minItems"] == numbers
    # A given tool gets as many candidates as designed ones.
    assert request.brief.n_tool * request.brief.n_action == 20


@pytest.mark.thorough
@pytest.mark.parametrize("kinds", rare(["rigid", "gripper"], "rigid"))
def test_evolution_shows_what_the_designs_earned(designs, kinds):
    request = composed(
        "prompt=evolve", f"designs={designs}", f"task.tool_kinds=[{kinds}]"
    )
    block = re.search(
        r"## The elites\n.*?```json\n(.*?)```", text_of(request), re.DOTALL
    )
    first, second = json.loads(block[1])
    assert (first["tool_name"], first["id"]) == ("good", "g0-a0-s1-p1")
    assert first["reward"] > 0.95
    assert (second["tool_name"], second["reward"]) == ("idle", 0.0)
    assert request.id == "g1-a0"
    assert ("of the other kind" in text_of(request)) == (kinds == "gripper")


@pytest.mark.parametrize("picture", rare([True, False], False))
def test_the_scene_is_drawn_if_the_settings_say_so(picture):
    """Of two kinds of tools, gripper tools get a picture with the hand, rigid ones a picture without."""
    words = [
        f"prompt.picture={picture}",
        "task=OneBook",
        "task.tool_kinds=[rigid,gripper]",
        "sim=mujoco",
    ]
    by_kind = {}
    for agent in range(8):
        request = composed(*words, f"agent={agent}")
        by_kind.setdefault(request.brief.gripper, request)
        if len(by_kind) == 2:
            break
    pictures = set()
    for gripper, request in by_kind.items():
        drawn = [
            part for part in request.messages[-1].parts if isinstance(part, Picture)
        ]
        assert [part.name for part in drawn] == [
            "scene_gripper" if gripper else "scene"
        ] * picture
        assert ("## Picture" in text_of(request)) == picture
        pictures |= {part.png for part in drawn}
    assert len(pictures) == 2 * picture


@pytest.mark.thorough
def test_elites_are_at_most_k_top_and_may_be_drawn(designs):
    request = composed(f"designs={designs}", "budget.k_top=1", "prompt.feedback=full")
    assert [elite.candidate.id for elite in request.brief.elites] == ["g0-a0-s1-p1"]
    scene, elite, failure = [
        part for part in request.messages[-1].parts if isinstance(part, Picture)
    ]
    assert (scene.name, elite.name) == ("scene", "strip_g0-a0-s1-p1")
    assert failure.name in ("strip_g0-a0-s0-p0", "strip_g0-a0-s1-p0")
    assert '"result": "solved"' in text_of(request)


@pytest.mark.parametrize(
    ("overrides", "reason"),
    [
        (["prompt=evolve"], "this prompt evolves elites, and there are none"),
        (["designs=missing.json"], "designs file missing.json: there is no such file"),
        (["prompt=human"], "prompt.file is empty"),
        (["agent=-1"], "agent must be 0 or greater"),
        (["tool=rlbench"], "no given tool for task 'OneBook'"),
        (["task.tool_kinds=[rigd]"], "no tool kind 'rigd'"),
    ],
)
def test_mistakes(overrides, reason):
    with pytest.raises(UserError, match=re.escape(reason)) as error:
        composed(*overrides)
    assert "\n" not in str(error.value)


def test_a_rule_for_tools_that_can_not_be_imported_is_said_at_once(monkeypatch):
    offer = Offer("tool_rule", "far", "lab", "my-lab", "no_such_lab:rule")
    monkeypatch.setitem(installed().offers, ("tool_rule", "far"), offer)
    with pytest.raises(UserError, match="tool_rule 'far' of my-lab can't be imported"):
        composed()


def test_designs_that_make_no_elites(tmp_path):
    (good,) = json.loads(SOLUTION.read_text())["strategies"]
    file = tmp_path / "designs.json"
    file.write_text(json.dumps({"strategies": [good | {"tool_urdf": "<link/>"}]}))
    with pytest.raises(
        UserError,
        match=re.escape("none of its designs can be an elite; the first reason: "),
    ):
        composed(f"designs={file}")


@pytest.mark.thorough
def test_the_command_writes_what_would_be_sent(tmp_path):
    words = [
        "task=OneBook",
        "sim=mujoco",
        "vlm=litellm",
        "vlm.model=openai/gpt-4.1",
        "output=there",
        "budget.n_tool=2",
        "agent=3",
    ]
    done = python_m(tmp_path, "core", "prompt", *words)
    assert done.returncode == 0, done.stderr
    assert not done.stderr  # no key is needed, no request is sent
    folder = tmp_path / "there"
    request = composed("budget.n_tool=2", "agent=3")
    system, user = request.messages
    assert (folder / "system.md").read_text() == system.parts[0].text
    assert (folder / "user.md").read_text() == as_markdown(user)
    (scene,) = [part for part in user.parts if isinstance(part, Picture)]
    assert (folder / "scene.png").read_bytes() == scene.png
    assert json.loads((folder / "schema.json").read_text()) == request.schema
    sent = json.loads((folder / "request.json").read_text())
    assert (sent["id"], sent["seed"], sent["temperature"]) == (
        "g0-a3",
        request.brief.seed,
        request.temperature,
    )
    estimate = sent["estimate"]
    tokens = estimate["prompt_tokens"]
    assert abs(tokens / VLM.estimate(request, "any").prompt_tokens - 1) < 0.2
    assert (estimate["usd_per_prompt_token"], estimate["counted_by"]) == (
        2e-6,
        "litellm.token_counter",
    )
    first, generation, shared, repair, last = done.stdout.splitlines()
    assert first == f"{tokens} tokens for openai/gpt-4.1 (litellm.token_counter)"
    assert generation.startswith("a generation has at most ")
    assert "cost less where the provider keeps them" in shared
    assert "prompt.repair" in repair
    assert last == "there"


def test_without_a_language_model_tokens_are_estimated_from_the_length(
    tmp_path, capsys
):
    words = [
        "task=OneBook",
        "sim=mujoco",
        "vlm=offline",
        f"output={tmp_path}",
        "prompt.picture=false",
    ]
    main(words)
    said = capsys.readouterr().out
    assert "rule of thumb: 3 characters to a token, 800 tokens to a picture" in said


@pytest.mark.thorough
def test_an_output_that_can_not_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="can't write"):
        main(["task=OneBook", "sim=mujoco", f"output={tmp_path / 'file'}"])
