"""The prompts describe the code: complete, independent of this machine, and with the right signs."""

import json
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import prompts
from core.config.compose import load, node
from core.config.schemas import PARTS, PromptSettings
from core.design import RIGID_MOUNT, Candidate, Component, Tool
from core.designs.composer import PromptComposer
from core.designs.prompt_templates import SUFFIX
from core.designs.prompt_values import RunFacts
from core.designs.rules import check_tool
from core.designs.schema import answer_schema
from core.designs.start import SpawnRules
from core.errors import UsageError, UserError
from core.geometry import Box, Cylinder, Pose
from core.interfaces import (
    Observation,
    Picture,
    Reply,
    Request,
    Text,
)
from core.plugins import installed
from core.search.answers import Answer
from core.simulation.measuring import describe_order
from core.trial import Evaluation, Score, Trial, Where
from core.values.robots import ISO_9409_1_50
from plugins.conformance.evaluations import tried_once
from plugins.vlms.context.excerpts import task_source
from plugins.vlms.critic import CRITIC
from plugins.vlms.recalling import TEMPLATE
from plugins.vlms.second_look import REPAIR, SecondLook
from tests.support.briefs import Bar, PushCube, make_brief, make_elite
from tests.support.panda import PANDA
from tests.support.rare import rare

pytestmark = pytest.mark.slow

FOLDER = Path(prompts.__file__).parent
PICTURE = Picture(b"\x89PNG")


ELITES = (make_elite(0, 0.87654321), make_elite(1, 0.6))


SOURCE = task_source(PushCube())


def words(messages):
    """All text except the task's source, which is this file, and would match every test."""
    text = "".join(
        part.text
        for message in messages
        for part in message.parts
        if isinstance(part, Text)
    )
    assert text.count(SOURCE) == 1  # verbatim
    return text.replace(SOURCE, "SOURCE")


def prompt(facts=None, **changes):
    """The text for a changed brief, without a picture."""
    return words(PromptComposer(facts).compose(make_brief(**changes)))


def elites_in(text):
    """What a prompt says before its list of elites, the list as text, and the list."""
    block = re.search(r"## The elites?\n(.*?)```json\n(.*?)```", text, re.DOTALL)
    assert block is not None
    return block[1], block[2], json.loads(block[2])


BRIEFS = {
    "initial rigid": make_brief(),
    "initial gripper": make_brief(gripper=True),
    "evolution rigid": make_brief(elites=ELITES),
    "evolution gripper": make_brief(elites=ELITES, gripper=True),
    "one tool, one plan": make_brief(n_tool=1, n_action=1),
    "one of everything": make_brief(n_tool=1, n_action=1, elites=ELITES[:1]),
}


# --- what is composed -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", rare(BRIEFS, "initial rigid", "evolution gripper"))
def test_contents_of_every_prompt(name):
    brief = BRIEFS[name]
    system, user = PromptComposer().compose(brief, [PICTURE])
    assert (system.role, user.role) == ("system", "user")
    texts = [part for part in user.parts if part != PICTURE]
    assert len(texts) == len(user.parts) - 1
    assert all(isinstance(part, Text) and part.text.endswith("\n\n") for part in texts)
    text = words((system, user))
    assert "```python\nSOURCE\n" in text
    assert brief.task.description in text
    assert brief.representation.instructions(brief) in text
    assert "(0.4, -0.2, 0.2)" in text
    assert "| cube | 1.2 0 0.025 | box 0.05 0.05 0.05 |" in text
    papers = words(
        PromptComposer(RunFacts(settings_of("paper"))).compose(brief, [PICTURE])
    )
    for source in ("class Body:", "def execute(", "<joint name="):
        assert source in papers
        assert source not in text
    for noise in (
        "<inertial>",
        "<dynamics",
        "<safety_controller",
        "def inertia(",
        "class Reach",
        "class Task(",
    ):
        assert noise not in text
    for folder in (
        FOLDER.parent,
        Path.home(),
        Path(sys.prefix),
        Path(pin.__file__).parents[1],
        "package://",
        ".stl",
    ):
        assert str(folder) not in text
    schema = json.dumps(answer_schema(brief), separators=(",", ":"))
    # Each field that the schema requires of a design is named in the rules.
    assert f"`gripper`: {json.dumps(brief.gripper)}" in text
    assert schema in text
    # The model gets it otherwise.
    assert schema not in words(PromptComposer().compose(brief, [PICTURE], schema=False))


def test_elites_are_shown():
    text = prompt(RunFacts(PromptSettings(feedback="paper")), elites=ELITES)
    _, _, (first, second) = elites_in(text)
    assert first == {
        "id": "g0-a0-s0-p0",
        "reward": 0.8765,
        "strategy_name": "Push 0",
        "strategy_description": "",
        "tool_name": "Bar 0",
        "tool_description": "A long bar.",
        "gripper": False,
        "xml": '<bar name="bar0"/>\n',
    }
    assert (second["id"], second["reward"]) == ("g0-a0-s1-p0", 0.6)
    assert "crossover" in text.split("# Evolution rules")[1]


# --- what a design is judged by, and what is left to gain -------------------------------------------------------


def test_a_fitness_says_what_counts_and_its_figures_come_back():
    plain = prompt(elites=ELITES)
    assert "judged by" not in plain
    assert "`details`" not in plain
    trials = (
        Trial(Where("Task", "one", 0, 1), reward=0.5),
        Trial(Where("Task", "one", 0, 2), reward=0.524690),
    )
    score = Score(ELITES[0].reward, {"cost": float("nan")})
    elites = (replace(ELITES[0], trials=trials, score=score), ELITES[1])
    facts = RunFacts(judged=" The worst of three {{ trials }}.\n")
    text = prompt(facts, elites=elites)
    assert "## What a design is judged by\nThe worst of three {{ trials }}.\n\n" in text
    _, _, (first, second) = elites_in(text)
    lines = ["0.500 in one layout 0 change 1", "0.525 in one layout 0 change 2"]
    assert first["details"] == {
        "trials": lines,
        "cost": None,
    }
    assert "details" not in second
    assert "`details` says what became of the `trials`" in text


@pytest.mark.parametrize(
    ("reward", "solved", "room"),
    [(0.5, False, False), (0.999, False, False), (0.999, True, True)],
)
def test_where_trials_decide_room_is_left_to_gain_and_numbers_may_change_a_little(
    reward, solved, room
):
    elites = (make_elite(0, reward, solved=solved), make_elite(1, 0.4))
    text = " ".join(prompt(RunFacts(judged="In two layouts."), elites=elites).split())
    assert (
        "count as equal: of them, where no further trials decide, the pair with the most room"
        in text
    )
    for said in (
        "the most room to its limits is shown first and wins",
        "where the elites had least room",
    ):
        assert (said in text) == room
    free = "**keeps the tool** of an elite and changes the plan"
    assert free in text
    paper = prompt(RunFacts(PromptSettings(feedback="paper")), elites=elites)
    assert free not in paper
    assert ("change some numbers a little, of one component" in paper) == room
    assert "saves way" not in text
    assert "further trials" not in prompt(elites=ELITES)


def test_the_order_of_the_run_is_that_of_the_prompt():
    def mission(*decides):
        return " ".join(prompt(RunFacts(decides=decides)).split())

    default = " ".join(prompt(RunFacts()).split())
    assert (
        "with the most room to its limits wins, then the one with the shortest way."
        in default
    )
    paper = mission(*describe_order("distance_m"))
    assert "of them, the pair with the shortest way of the end-effector wins." in paper
    motion = mission(*describe_order("motion_s"))
    assert "of them, the pair with the lowest `motion_s` wins." in motion


# --- measurements of elites ------------------------------------------------------------------------------------

FIGURES = {
    "distance_m": 1.23456,
    "observation": Observation(
        "missed", miss=(1, 0.0711111, 0.5), lag_rad=0.02, arrivals=(1.0, 2.0)
    ),
    "warnings": ("it fell",),
}


@pytest.mark.parametrize("feedback", ["paper", "numbers", "full"])
def test_feedback(feedback):
    plan = np.array([[0.5, 0.0, 0.123456, 0, 0, 1.5], [0.4, 0, 0.1, 0, 0, 0]])
    elite = tried_once(
        replace(ELITES[0].candidate, plan=plan), "ok", ELITES[0].reward, **FIGURES
    )
    pictures = (
        {"g0-a0-s0-p0": Picture(b"elite", "elite_g0-a0-s0-p0", "An elite.")}
        if feedback == "full"
        else {}
    )
    prompts = PromptComposer(RunFacts(PromptSettings(feedback=feedback)))
    messages = prompts.compose(
        make_brief(elites=(elite, ELITES[1])), [PICTURE], pictures
    )
    text = words(messages)
    _, listed, (first, second) = elites_in(text)
    shown = {
        "action_plan": [[0.5, 0, 0.1235, 0, 0, 1.5], [0.4, 0, 0.1, 0, 0, 0]],
        "distance_m": 1.2346,
        "result": "missed",
        "arrivals_s": [1.0, 2.0],
        "missed": "way to waypoint 1 missed by 71 mm, 0.50 rad",
        "lag": "lag 0.02 rad at 0.00 s (to waypoint 1)",
    }
    assert {key: first.get(key) for key in shown} == (
        shown if feedback != "paper" else dict.fromkeys(shown)
    )
    assert ("warnings" in first) == (feedback != "paper")
    assert second.get("distance_m") is None  # nan
    # One line per waypoint.
    assert ("[0.4, 0.0, 0.1, 0.0, 0.0, 0.0]" in listed) == (feedback != "paper")
    assert ("that earned the rewards are not shown" in text) == (feedback == "paper")
    for name in {*shown} - {"result"}:
        assert (f"`{name}`" in text) == (feedback != "paper")
    assert ("A film strip follows" in text) == (feedback == "full")
    parts = messages[-1].parts
    assert parts[parts.index(PICTURE) - 1].text.startswith("## Picture")
    if feedback == "full":
        assert parts[-2:] == (Text("An elite.\n\n"), pictures["g0-a0-s0-p0"])


def test_unknown_feedback_is_an_error():
    with pytest.raises(
        UsageError,
        match=r"no feedback 'ful' in prompt.feedback \(did you mean 'full'\?\)",
    ):
        PromptComposer(RunFacts(PromptSettings(feedback="ful")))


class GivenBar(Bar):
    def given(self, task):
        return Tool(
            (Component("bar", RIGID_MOUNT, Pose(), Box((0.01, 0.01, 0.2))),),
            name="bar",
            description="it is",
        )

    def schema(self):
        return {}

    def dump(self, tool):
        return {}


def test_plans_for_a_given_tool_start_from_the_best_ones():
    first = prompt(representation=GivenBar(), n_tool=1)
    assert "best plans so far" not in first
    brief = make_brief(representation=GivenBar(), n_tool=1, elites=ELITES)
    later = words(PromptComposer().compose(brief))
    assert "## The best plans so far" in later
    assert '"action_plan"' in later
    assert "`parents`" in later
    assert (
        "parents"
        in answer_schema(brief)["properties"]["strategies"]["items"]["properties"]
    )


# --- a person's idea --------------------------------------------------------------------------------------------


@pytest.fixture
def idea(tmp_path):
    file = tmp_path / "my_idea.md"
    file.write_text("\ufeff Take a broom {{ brief }}.\n", encoding="utf-8")
    return file


@pytest.mark.parametrize(
    "brief",
    [
        make_brief(),
        make_brief(elites=ELITES),
        make_brief(representation=GivenBar(), n_tool=1),
    ],
)
def test_a_persons_idea_is_passed_on(idea, brief):
    text = words(
        PromptComposer(RunFacts(settings_of("human", f"prompt.file={idea}"))).compose(
            brief
        )
    )
    assert text.count("```text\nTake a broom {{ brief }}.\n```") == 1
    assert "wide range" not in text
    assert "Think of a tool" not in text
    assert text.index("\n# The colleague's instructions") < text.index("\n# Procedure")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "there is no such file"),
        (None, "can't be read: Is a directory"),
        (b"", "is empty; describe the tool"),
        (b" \n<!-- nothing\nbut a comment -->", "is empty; describe the tool"),
        (b"\xff\xfe", "is not UTF-8 text"),
        (b"x" * 60_000, "has 0.1 MB; at most 0.05 MB"),
    ],
)
def test_files_that_hold_no_idea(tmp_path, content, reason):
    file = (
        tmp_path / "idea.md" if reason != "can't be read: Is a directory" else tmp_path
    )
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(UserError, match=reason) as error:
        PromptComposer(RunFacts(settings_of("human", f"prompt.file={file}")))
    assert str(error.value).startswith(f"prompt.file={file}")
    assert "\n" not in str(error.value)


def test_evolution_alone_needs_elites():
    prompts = PromptComposer(RunFacts(settings_of("evolve")))
    assert "## The elites" in words(prompts.compose(make_brief(elites=ELITES)))
    with pytest.raises(
        UserError, match="this prompt evolves elites, and there are none"
    ):
        prompts.compose(make_brief())


# --- a repair ---------------------------------------------------------------------------------------------------


def test_a_repair_shows_the_reply_and_its_problem():
    brief = make_brief()
    first = Request("g0-a0", brief, PromptComposer().compose(brief, [PICTURE]), {}, 1.0)
    mender = SecondLook(PromptComposer())
    unread = Answer(first, first)
    messages = mender.look_again(
        unread, Reply("g0-a0", "I {{ think }}", "m"), "it has no {{ JSON }}"
    ).messages
    assert messages[:2] == first.messages
    assert [m.role for m in messages[2:]] == ["assistant", "user"]
    assert messages[2].parts == (Text("I {{ think }}"),)
    assert "can't be read: it has no {{ JSON }}." in messages[3].parts[0].text
    empty = mender.look_again(unread, Reply("g0-a0", " \n", "m"), "it is empty")
    assert [m.role for m in empty.messages] == ["system", "user", "user"]


# --- one elite, or of the other kind ----------------------------------------------------------------------------


@pytest.mark.parametrize("gripper", [False, True])
def test_elites_of_the_other_kind_are_marked(gripper):
    same, other = (
        prompt(gripper=gripper, elites=(make_elite(0, 1, gripper=kind),))
        for kind in (gripper, not gripper)
    )
    assert "of the other kind" not in same
    assert f"`gripper` is {json.dumps(not gripper)}, it is of the other kind" in other


def test_an_elite_without_a_tool_is_an_error():
    elite = Evaluation(Candidate(None, np.zeros((0, 6)), problem="no tool"))
    with pytest.raises(ValueError, match="g0-a0-s0-p0 has no tool"):
        PromptComposer().compose(make_brief(elites=(elite,)))


# --- the templates ----------------------------------------------------------------------------------------------


def test_each_template_is_used():
    used = {REPAIR, CRITIC, TEMPLATE}.union(*PARTS.values())
    for name in ("human", "paper"):
        settings = settings_of(name)
        used |= {*settings.initial, *settings.evolution, *settings.given}
    assert {file.name.removesuffix(SUFFIX) for file in FOLDER.glob("*.j2")} == used


def from_folder(folder):
    return PromptComposer(RunFacts(PromptSettings(dir=str(folder))))


def settings_of(name, *overrides):
    """The settings of one config of the group ``prompt``."""
    return node(load("config", [f"prompt={name}", *overrides]).prompt, PromptSettings)


@pytest.fixture
def folder(tmp_path):
    return Path(
        shutil.copytree(
            FOLDER,
            tmp_path / "mine",
            ignore=shutil.ignore_patterns("*.py", "__pycache__"),
        )
    )


def test_another_folder(folder):
    (folder / "units.md.j2").write_text(
        "# Units\nInches, for {{ task.name }}.\n", encoding="utf-8"
    )
    assert "Inches, for PushCube." in words(from_folder(folder).compose(make_brief()))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# Units\n{% if %}", r"units\.md\.j2, line 2: "),
        (
            "{{ brif.n_tool }}",
            r"units\.md\.j2: 'brif' is undefined; a template may use: action_rules, arm, bare, ",
        ),
        ("{{ brief.__class__.__mro__ }}", r"units\.md\.j2: .*unsafe"),
    ],
)
def test_a_template_that_cannot_be_used_is_an_error(folder, text, said):
    (folder / "units.md.j2").write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=said) as error:
        from_folder(folder).compose(make_brief())
    assert "\n" not in str(error.value)


def test_what_is_missing_is_an_error(folder):
    (folder / "units.md.j2").rename(folder / "unit.md.j2")
    with pytest.raises(
        UserError,
        match=r"no prompt template 'units\.md\.j2' .*did you mean 'unit\.md\.j2'",
    ) as error:
        from_folder(folder)
    assert "\n" not in str(error.value)
    with pytest.raises(
        UserError, match=r"no prompt folder .*nowhere; name a folder of templates"
    ):
        from_folder(folder / "nowhere")


# --- the schema -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("gripper", "numbers"), [(False, 6), (True, 7)])
def test_schema_counts(gripper, numbers):
    schema = answer_schema(make_brief(gripper=gripper))
    strategies = schema["properties"]["strategies"]
    assert (strategies["minItems"], strategies["maxItems"]) == (3, 3)
    fields = strategies["items"]["properties"]
    plans = fields["action_sets"]
    assert (plans["minItems"], plans["maxItems"]) == (4, 4)
    plan = plans["items"]
    assert plan["minItems"] == 1
    assert "maxItems" not in plan
    assert plan["items"] == {
        "type": "array",
        "items": {"type": "number"},
        "minItems": numbers,
        "maxItems": numbers,
    }
    assert fields["gripper"] == {"type": "boolean", "enum": [gripper]}
    assert fields["xml"] == {"type": "string", "description": "the bar"}
    assert "parents" not in fields


def test_an_agent_is_told_the_same_of_numbers_everywhere():
    brief = make_brief(alone=True, n_tool=1, n_action=1, curves=20)
    said = words(PromptComposer().compose(brief, [PICTURE]))
    for other in ("bold", "Answer with one JSON", "elites", "the next prompt"):
        assert other not in said
    strategies = answer_schema(brief)["properties"]["strategies"]
    plans = strategies["items"]["properties"]["action_sets"]
    for several in (strategies, plans):
        assert several["minItems"] == 1
        assert "maxItems" not in several


@pytest.mark.parametrize("elites", [(), ELITES])
def test_schema_is_closed_and_complete(elites):
    schema = answer_schema(make_brief(elites=elites))
    text = json.dumps(schema)
    assert text.count('"object"') == 2
    for each in (schema, schema["properties"]["strategies"]["items"]):
        assert each["additionalProperties"] is False
        assert each["required"] == list(each["properties"])
    assert json.loads(text) == schema


@pytest.mark.parametrize("count", [1, 2])
def test_offspring_name_their_parents(count):
    strategy = answer_schema(make_brief(elites=ELITES[:count]))["properties"][
        "strategies"
    ]["items"]
    ids = ["g0-a0-s0-p0", "g0-a0-s1-p0"][:count]
    parents = {
        "type": "array",
        "items": {"type": "string", "enum": ids},
        "minItems": 1,
        "maxItems": count,
    }
    assert strategy["properties"]["parents"] == parents


# --- other arms -------------------------------------------------------------------------------------------------


UR5 = installed().create("robot", "ur5")


@pytest.mark.parametrize(
    "robot",
    [PANDA, replace(UR5, flange=replace(ISO_9409_1_50, disc=Cylinder(0.03, 0.004)))],
)
@pytest.mark.parametrize("gripper", [False, True])
def test_the_example_of_a_tool_can_be_used(robot, gripper):
    if gripper and robot.gripper is None:
        return
    task = PushCube()
    task.robot = robot
    urdf = installed().create("tool", "urdf", robot=robot)
    brief = make_brief(task=task, gripper=gripper, representation=urdf)
    text = urdf.instructions(brief)
    example = text.partition("Example of one link and its joint:\n")[2]
    tool = urdf.parse({"tool_urdf": example}, gripper=gripper)
    check_tool(tool, robot)
    SpawnRules(task, 0).check(tool)
    assert robot is PANDA or "mm diameter and 4 mm thickness" in text
