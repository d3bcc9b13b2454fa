"""The mailbox, with a thread in the place of the person."""

import json
import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from core.config.compose import load
from core.errors import UsageError, UserError
from core.interfaces import Brief, Message, Picture, Request, Text
from core.plugins import installed
from core.search.orchestration import run
from plugins.actions.anchored import AnchoredActions
from plugins.actions.waypoints import WaypointActions
from plugins.vlms.mailbox import Mailbox, judge
from tasks.bring_cube import BringCube
from tests.support.evaluations import evaluation
from tests.support.panda import on_panda

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
SOLUTION = json.loads((ROOT / "tests/tasks/solutions/BringCube.json").read_text())
STRATEGY = SOLUTION["strategies"][0]
GOOD = json.dumps(SOLUTION)
QUICK = {"poll_s": 0.02}


def document(*strategies):
    return json.dumps({"strategies": strategies})


@pytest.fixture
def box(tmp_path):
    """The folder of the first request; it is made when that is asked."""
    return tmp_path / "g0-a0"


def request(agent=0, text="Design.", n_tool=2):
    tools = installed().create("tool", "urdf")
    counts = (n_tool, 2, 0, agent, 0)
    task = on_panda(BringCube())
    brief = Brief(task, 0, tools, False, *counts, actions=WaypointActions())
    user = Message(
        "user",
        (
            Text(f"{text} {agent}\n\n"),
            Picture(b"\x89PNG"),
            Picture(b"\x89elite", "elite_x"),
        ),
    )
    return Request(
        f"g0-a{agent}",
        brief,
        (Message("system", (Text("Be bold.\n\n"),)), user),
        {"type": "object"},
        1.0,
    )


class Person(threading.Thread):
    """Performs ``acts`` in order, each when its condition holds."""

    def __init__(self, *acts):
        super().__init__(daemon=True)
        self.acts = acts
        self.error = None
        self.start()

    def run(self):
        try:
            for when, act in self.acts:
                wait_for(when)
                act()
        except Exception as error:
            self.error = error

    def done(self):
        self.join(30)
        assert self.error is None
        assert not self.is_alive()


def wait_for(condition, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it never came to that"
        time.sleep(0.01)


def answered(folder, *acts, poll_s=0.02, amend=False):
    """Complete a request while a person acts; return the reply."""
    person = Person(*acts)
    (reply,) = Mailbox(str(folder), poll_s, amend).complete([request()])
    person.done()
    return reply


def writes(file, text):
    return lambda: file.write_text(text)


def exists(file):
    return file.exists


def says(file, text):
    return lambda: file.is_file() and text in file.read_text()


def answers(box, text=GOOD):
    """Once a request is there, its reply is written."""
    return exists(box / "prompt.md"), writes(box / "reply.json", text)


def problem(box):
    return (box / "problem.md").read_text()


# --- requests and replies ---------------------------------------------------------------------------------------


def test_a_request_becomes_a_folder_and_a_reply_is_read(tmp_path, box, capsys):
    reply = answered(tmp_path, answers(box))
    assert (reply.request_id, reply.text, reply.error) == ("g0-a0", GOOD, None)
    assert (reply.prompt_tokens, reply.cost_usd) == (None, None)
    prompt = (box / "prompt.md").read_text()
    assert prompt.startswith("Be bold.\n\n")
    assert "Design. 0\n\n![scene](scene.png)\n\n![elite_x](elite_x.png)" in prompt
    last = prompt.splitlines()[-1]
    assert all(name in last for name in ("reply.json", "schema.json", "problem.md"))
    assert (box / "scene.png").read_bytes() == b"\x89PNG"
    assert (box / "elite_x.png").read_bytes() == b"\x89elite"
    assert json.loads((box / "schema.json").read_text()) == {"type": "object"}
    assert {file.name for file in box.iterdir()} == {
        *("prompt.md", "scene.png", "elite_x.png", "schema.json", "reply.json")
    }
    err = capsys.readouterr().err
    assert (
        f"mailbox: 1 request waits for an answer in {tmp_path}; put reply.json or reply.md"
        in err
    )


def test_a_later_request_names_what_it_has_in_common_with_a_first_one(tmp_path):
    """Even where a rule in the middle reads otherwise, such as one on elites."""
    same = "# Rules\n" + "Keep clear of the arm. " * 40
    first = request(text=f"{same}\n\n# Tools\nA tool.\n\n# What is wanted\nInvent.")
    more = "A tool. Elites are shown so."
    later = request(text=f"{same}\n\n# Tools\n{more}\n\n# What is wanted\nEvolve.")
    later = replace(later, id="g1-a0", brief=replace(later.brief, generation=1))
    for asked in (first, later):
        (tmp_path / asked.id).mkdir()
        (tmp_path / asked.id / "reply.json").write_text(GOOD)
        for _ in range(2):  # a resumed run finds the same text
            list(Mailbox(str(tmp_path), **QUICK).complete([asked]))
    assert "Keep clear" in (tmp_path / "g0-a0" / "prompt.md").read_text()
    text = (tmp_path / "g1-a0" / "prompt.md").read_text()
    assert text.startswith(
        "Rules and task, with their pictures, are those of `../g0-a0"
    )
    assert f"# Tools\n{more}\n\n# What is wanted\nEvolve" in text
    assert "Keep clear" not in text


@pytest.mark.parametrize(
    ("parents", "said"),
    [
        (["g0-a0-s0-p0"], False),
        (["g9-a9-s9-p9"], True),
        ([], True),
        (None, True),
    ],
)
def test_parents_that_are_missing_are_said(tmp_path, capsys, parents, said):
    asked = request()
    elite = evaluation(0, 0.5)
    brief = replace(asked.brief, generation=1, elites=(elite,))
    asked = replace(asked, id="g1-a0", brief=brief)
    design = STRATEGY if parents is None else STRATEGY | {"parents": parents}
    (tmp_path / asked.id).mkdir()
    (tmp_path / asked.id / "reply.json").write_text(document(design))
    assert [reply.text for reply in Mailbox(str(tmp_path), **QUICK).complete([asked])]
    line = "no `parents` in design 1, which counts as new; name those of g0-a0-s0-p0"
    assert (line in capsys.readouterr().err) == said


def test_replies_come_in_any_order_and_as_markdown(tmp_path, capsys):
    boxes = [tmp_path / f"g0-a{n}" for n in range(3)]
    chat = f"Sure! Here it is:\n```json\n{GOOD}\n```\nGood luck."
    person = Person(
        # What is there before the mailbox has looked once is taken without a word.
        (
            lambda: "3 requests wait for an answer" in capsys.readouterr().err,
            writes(boxes[2] / "reply.md", chat),
        ),
        (
            lambda: "g0-a2 is answered; 2 left" in capsys.readouterr().err,
            writes(boxes[0] / "reply.json", GOOD),
        ),
        (lambda: True, writes(boxes[1] / "skip", "")),
    )
    replies = list(
        Mailbox(str(tmp_path), **QUICK).complete([request(n) for n in range(3)])
    )
    person.done()
    assert (replies[0].request_id, replies[0].text) == ("g0-a2", chat)
    skipped = next(r for r in replies if r.request_id == "g0-a1")
    assert (skipped.text, skipped.error) == ("", "skipped by hand")


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (b"I can't help with that.", "no JSON object"),
        (b'{"strategies": []}', "'strategies' is empty"),
        (GOOD[:300].encode(), "malformed JSON at line 1"),
        (b"\xff\xfe", "is not UTF-8 text"),
        (b'{"strategies": [{"tool_urdf": "<link/>"}]}', "design 1: "),
        (
            document(STRATEGY | {"action_sets": [[[9] * 6]]}).encode(),
            "x is 9; it must be between",
        ),
    ],
)
def test_a_reply_without_a_usable_design_is_refused(tmp_path, box, bad, reason, capsys):
    box.mkdir()
    problems = []

    def mend():
        problems.append(problem(box))
        (box / "reply.json").write_text(GOOD)

    reply = answered(
        tmp_path,
        (exists(box / "prompt.md"), lambda: (box / "reply.json").write_bytes(bad)),
        (exists(box / "problem.md"), mend),
    )
    assert reply.text == GOOD
    assert problems[0].startswith("reply.json can't be used:\n\n- ")
    assert reason in problems[0]
    assert "a file named skip" in problems[0]
    assert not (box / "problem.md").exists()
    said = capsys.readouterr().err
    assert said.count("can't be used") == 1  # once, not at each look
    assert str(box / "problem.md") in said


def test_rejected_designs_of_an_accepted_reply_are_listed(tmp_path, box):
    text = document(STRATEGY, STRATEGY | {"tool_urdf": "<link/>"})
    reply = answered(tmp_path, answers(box, text))
    assert reply.text == text
    listed = problem(box)
    assert listed.startswith(
        "reply.json is accepted; these of its designs will be rejected:\n\n- design 2: "
    )
    assert "design 1" not in listed


@pytest.mark.parametrize("accepted", [True, False])
def test_faulty_designs_are_amended_or_accepted(tmp_path, box, accepted, capsys):
    text = document(STRATEGY, STRATEGY | {"action_sets": [[[9] * 6]]})
    act = writes(box / "reply.json", GOOD)
    if accepted:
        act = writes(box / "accept", "")
    reply = answered(
        tmp_path,
        answers(box, text),
        (says(box / "problem.md", "put a file named accept"), act),
        amend=True,
    )
    assert reply.text == (text if accepted else GOOD)
    assert "some designs of reply.json can't be tried" in capsys.readouterr().err
    assert (box / "problem.md").exists() == accepted


def test_a_reply_is_judged_by_the_runs_own_representation_of_plans():
    asked = request()
    anchored = replace(asked, brief=replace(asked.brief, actions=AnchoredActions()))
    plan = [{"anchor": "cube", "offset": [0.0, 0.0, 0.4]}]
    text = document(STRATEGY | {"action_sets": [plan]})
    assert judge(anchored, text) == (True, [])
    assert judge(anchored, GOOD) == (True, [])  # literal waypoints stand in the world
    assert judge(asked, text)[0] is False


def test_a_reply_that_is_still_being_written_is_waited_for(tmp_path, box):
    """Even if it can be read so far: the first of two strategies is complete long before the second."""
    text = document(STRATEGY, STRATEGY)

    def slowly():
        with (box / "reply.json").open("w") as file:
            for start in range(0, len(text), 200):
                file.write(text[start : start + 200])
                file.flush()
                time.sleep(0.05)

    reply = answered(tmp_path, (exists(box / "prompt.md"), slowly), poll_s=0.2)
    assert reply.text == text
    assert not (box / "problem.md").exists()


def test_a_reply_that_cut_by_off_is_read_when_its_file_rests(tmp_path, box):
    text = document(STRATEGY, STRATEGY)[:-30]
    reply = answered(
        tmp_path, (exists(box / "prompt.md"), writes(box / "reply.md", text))
    )
    assert reply.text == text
    assert "design 2: the design is cut off" in problem(box)


def test_a_large_reply_or_a_folder_is_refused(tmp_path, box, monkeypatch):
    monkeypatch.setattr("plugins.vlms.mailbox.MAX_BYTES", 100_000)
    large = GOOD + " " * 100_000
    answered(
        tmp_path,
        answers(box, large),
        (
            exists(box / "problem.md"),
            lambda: (box / "problem.md").rename(box / "first.md"),
        ),
        (lambda: True, lambda: (box / "reply.md").mkdir()),
        (exists(box / "problem.md"), writes(box / "skip", "")),
    )
    assert (
        "reply.json has 0.1 MB; at most 0.1 MB are read"
        in (box / "first.md").read_text()
    )
    assert "reply.md can't be read: Is a directory" in problem(box)


# --- folders that others may write to ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["prompt.md", "schema.json", "scene.png", "prompt.partial", "problem.md"]
)
def test_nothing_is_written_through_a_link(name, tmp_path):
    private = tmp_path / "private"
    box = tmp_path / "mailbox" / "g0-a0"
    private.write_text("mine")
    box.mkdir(parents=True)
    (box / name).symlink_to(private)
    answered(
        tmp_path / "mailbox",
        (
            says(box / "prompt.md", "Design."),
            writes(box / "reply.json", "Here you are."),
        ),
        (says(box / "problem.md", "can't be used"), writes(box / "skip", "")),
    )
    assert private.read_text() == "mine"
    assert not (box / name).is_symlink() or name == "prompt.partial"


def test_a_folder_that_is_a_link_is_not_written_to(tmp_path):
    (tmp_path / "private").mkdir()
    (tmp_path / "mailbox").mkdir()
    (tmp_path / "mailbox" / "g0-a0").symlink_to(tmp_path / "private")
    with pytest.raises(UserError, match=r"can't be used: .*it is a link to .*private"):
        list(Mailbox(str(tmp_path / "mailbox")).complete([request()]))
    assert not list((tmp_path / "private").iterdir())


def test_a_reply_is_not_read_through_a_link_and_a_pipe_is_not_waited_for(tmp_path, box):
    (tmp_path / "private.json").write_text(GOOD)
    reply = answered(
        tmp_path,
        (exists(box / "prompt.md"), lambda: os.mkfifo(box / "reply.md")),
        (
            lambda: True,
            lambda: (box / "reply.json").symlink_to(tmp_path / "private.json"),
        ),
        (exists(box / "problem.md"), writes(box / "skip", "")),
    )
    assert reply.text == ""
    assert "it is a link; put the file itself there" in problem(box)


# --- again ------------------------------------------------------------------------------------------------------


def test_replies_that_are_already_there_are_read_at_once(tmp_path, box, capsys):
    answered(tmp_path, answers(box))
    os.utime(box / "reply.json", (0, 0))
    prompt = (box / "prompt.md").stat().st_mtime_ns
    capsys.readouterr()
    (reply,) = Mailbox(str(tmp_path), poll_s=1e6).complete([request()])
    assert reply.text == GOOD
    assert (box / "prompt.md").stat().st_mtime_ns == prompt
    assert capsys.readouterr().err == ""


def test_a_reply_to_another_request_is_refused(tmp_path, box):
    box.mkdir()
    (box / "prompt.md").write_text("another")
    # Unanswered: written anew.
    answered(
        tmp_path,
        (says(box / "prompt.md", "Design."), writes(box / "reply.json", GOOD)),
    )
    with pytest.raises(
        UserError, match=r"g0-a0 has a reply to a different request; move it away"
    ):
        list(Mailbox(str(tmp_path)).complete([request(text="Invent.")]))


def test_invalid_settings():
    with pytest.raises(UsageError, match=r"vlm\.poll_s must be greater than 0"):
        Mailbox(poll_s=0.0)


# --- a run ------------------------------------------------------------------------------------------------------

RUN = [
    *("vlm=mailbox", "vlm.poll_s=0.05"),
    *("budget=tiny", "budget.n_agent=2", "film=false"),
]


@pytest.mark.usefixtures("inline")
def test_a_run_answered_by_hand(tmp_path):
    folder = tmp_path / "run"
    box = folder / "mailbox"
    person = Person(
        answers(box / "g0-a0"),
        (exists(box / "g0-a1" / "prompt.md"), writes(box / "g0-a1" / "skip", "")),
    )
    result = run(load("config", [*RUN, "listener={}"]), folder)
    person.done()
    assert result.best.reward > 0.95
    assert [e.reason for e in result.generations[0].evaluations] == [
        "",
        "the model gave no answer: skipped by hand",
    ]
    assert (folder / "replies" / "g0-a0.txt").read_text() == GOOD
    assert "- g0-a0-s0-p0: 0.99" in (box / "g0-a0" / "results.md").read_text()
    skipped = (box / "g0-a1" / "results.md").read_text()
    assert "rejected: the model gave no answer: skipped by hand" in skipped
    assert (box / "g0-a0" / "scene.png").read_bytes() == (
        folder / "scene.png"
    ).read_bytes()
    assert "# Mission" in (box / "g0-a0" / "prompt.md").read_text()
    plan = json.loads((box / "g0-a0" / "schema.json").read_text())["properties"][
        "strategies"
    ]
    assert plan["maxItems"] == 1


def test_a_critique_is_any_text(tmp_path):
    asked = replace(request(), id="g1-critic0", schema={}, purpose="critiques")
    folder = tmp_path / "g1-critic0"
    folder.mkdir()
    (folder / "reply.md").write_text("It slips off at 1.2 s. {")
    (reply,) = Mailbox(str(tmp_path), **QUICK).complete([asked])
    assert (reply.text, reply.error) == ("It slips off at 1.2 s. {", None)
    assert (folder / "prompt.md").is_file()
    assert not (folder / "schema.json").exists()
    assert judge(asked, " \n") == (False, ["it is empty"])
