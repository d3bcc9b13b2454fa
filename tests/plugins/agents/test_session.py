"""Sessions of an agent with a run, by the protocol's own client."""

import asyncio
import json
import os
import re
import signal
import sqlite3

import pytest
from mcp.shared.exceptions import MCPError

from core.store.reader import StoredRun
from tests.plugins.agents.clients import (
    ROOT,
    SMALL,
    ask,
    converse,
    pictures,
    short,
    solution,
    start,
    text,
)

pytestmark = [pytest.mark.slow, pytest.mark.thorough]

PICTURES = (*SMALL, "prompt.context=pictures", "budget.n_rollouts=3", "folder=run")
# A number of a body: with a unit of length, or a decimal that is no reward, no time and no share.
BODY_NUMBER = re.compile(r"\d+(\.\d+)? ?(mm|cm|m|kg)\b")


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A session that was killed after its first trial, and the one that went on to the end; what each call gave."""
    folder = tmp_path_factory.mktemp("session")
    said = {}

    async def begin(client):
        said["tools"] = [tool.name for tool in (await client.list_tools()).tools]
        said["prompt"] = await client.get_prompt("invent")
        said["guide"] = await client.read_resource("vlmgineer://guide")
        said["designs"] = await client.read_resource("vlmgineer://designs")
        with pytest.raises(MCPError, match="no resource 'file:///etc/passwd'"):
            await client.read_resource("file:///etc/passwd")
        said["task"] = await ask(client, "describe_task")
        said["look"] = await ask(client, "look", {"designs": solution()})
        said["from"] = await ask(
            client, "look", {"position": [1.2, 0.8, 0.9], "target": [0.5, 0, 0.1]}
        )
        said["check"] = await ask(client, "check_design", {"designs": short()})
        said["rehearsed"] = await ask(
            client, "rehearse", {"designs": solution(), "waypoint": 2, "view": "top"}
        )
        said["early"] = await ask(client, "finish")
        progress = []

        async def note(done, total, message):
            progress.append((done, message))

        said["try"] = await ask(
            client, "try_design", {"designs": short()}, progress_callback=note
        )
        said["progress"] = progress
        os.kill(int((folder / "pid").read_text()), signal.SIGKILL)

    converse(begin, folder, *PICTURES)
    said["lost"] = (
        sqlite3.connect(folder / "run" / "run.sqlite")
        .execute("SELECT count(*) FROM trials")
        .fetchall()
    )

    async def go_on(client):
        said["again"] = await ask(client, "best_designs")
        said["watch"] = await ask(client, "watch", {"candidate": "g0-a0-s0-p0"})
        near = {"candidate": "g0-a0-s0-p0", "body": "cube"}
        said["near"] = await ask(client, "watch", near)
        two = solution()
        two["strategies"] = two["strategies"] * 3
        said["beyond"] = await ask(client, "try_design", {"designs": two})
        faulty = solution()
        faulty["strategies"][0]["tool_urdf"] = "<link name='a'/>"
        said["faulty"] = await ask(client, "try_design", {"designs": faulty})
        best = solution()
        best["strategies"][0]["parents"] = ["g0-a0-s0-p0"]
        said["second"] = await ask(client, "try_design", {"designs": best})
        said["finish"] = await ask(client, "finish")
        said["after"] = await ask(client, "try_design", {"designs": best})
        said["finished"] = await ask(client, "finish")
        said["seen"] = await ask(client, "watch", {"candidate": "g1-a0-s0-p0"})

    converse(go_on, folder, *PICTURES)
    return folder / "run", said


def test_the_tools_are_those_of_the_page(session):
    page = (ROOT / "docs" / "agents.md").read_text()
    _, said = session
    assert len(said["tools"]) >= 9
    assert all(f"`{name}`" in page for name in said["tools"])


def test_the_task_is_described_as_a_prompt_would(session):
    folder, said = session
    told = text(said["task"])
    assert "# The task: BringCube" in told
    assert "3 candidates left" in told
    assert len(pictures(said["task"])) == 6
    stored = (folder / "requests" / "g0-a0.md").read_text()
    assert "# The task: BringCube" in stored
    assert '"strategies"' in said["designs"].contents[0].text
    assert "try_design" in said["guide"].contents[0].text


def test_what_is_seen_is_a_picture(session):
    _, said = session
    for name in ("look", "from", "rehearsed", "watch", "near", "seen"):
        (picture,) = pictures(said[name])
        assert picture.width >= 640
        assert len(picture.getcolors(1_000_000)) > 100


def test_at_pictures_no_tool_says_a_number_of_a_body(session):
    _, said = session
    for name in ("check", "try", "again", "second", "faulty"):
        spoken = [line for line in text(said[name]).splitlines() if "cube" in line]
        for line in spoken:
            without_design = re.sub(
                r'"components": \[.*?\]|"action_plan": \[\[.*?\]\]', "", line
            )
            assert not BODY_NUMBER.search(without_design), line
    assert "nothing found" in text(said["check"])
    assert "cube" not in text(said["check"])


def test_a_rehearsal_at_pictures_says_no_gap(session):
    _, said = session
    words = text(said["rehearsed"])
    assert "layout 0, on the way to waypoint 2 of 3" in words
    assert "gaps" not in words


def test_a_plan_is_rehearsed_and_changed_by_difference(tmp_path):
    said = {}

    async def vary(client):
        given = {"designs": solution(), "waypoint": 1}
        said["played"] = await ask(client, "rehearse", given)
        said["beyond"] = await ask(client, "rehearse", {**given, "waypoint": 9})
        said["layout"] = await ask(client, "rehearse", {**given, "layout": 7})
        said["both"] = await ask(client, "rehearse", {**given, "candidate": "s0-p0"})
        await ask(client, "try_design", {"designs": solution()})
        lower = {"candidate": "s0-p0", "change": {"action_sets.0.0.2": 0.05}}
        said["lower"] = await ask(client, "check_design", lower)
        said["again"] = await ask(client, "try_design", {"candidate": "s0-p0"})

    converse(vary, tmp_path, *SMALL, "folder=run")
    (picture,) = pictures(said["played"])
    assert picture.width >= 640
    words = text(said["played"])
    assert "on the way to waypoint 1 of 3" in words
    assert re.search(r"gaps now, mm: cube \d+", words)
    assert "nothing found" in words
    assert "no waypoint 9; the plan has 3" in text(said["beyond"])
    assert "no layout 7 in the search; there are: 0" in text(said["layout"])
    assert "give a document, or else candidate" in text(said["both"])
    assert "mm into the fixed table" in text(said["lower"])
    stored = StoredRun(tmp_path / "run").designs()
    assert stored[1, 0, 0].parents == ("g0-a0-s0-p0",)


def test_a_try_for_less_costs_what_it_plays(tmp_path):
    said = {}

    async def ask_for_less(client):
        given = {"designs": solution()}
        said["one"] = await ask(client, "try_design", {**given, "layouts": [2]})
        second = {**given, "engine": "pybullet", "layouts": [2]}
        said["other"] = await ask(client, "try_design", second)
        said["none"] = await ask(client, "try_design", {**given, "engine": "bullet"})
        said["best"] = await ask(client, "best_designs")
        said["seen"] = await ask(client, "watch", {"candidate": "g0-a1-s0-p0"})

    async def go_on(client):
        said["again"] = await ask(client, "best_designs")
        said["whole"] = await ask(client, "try_design", {"designs": solution()})
        one = {"designs": short(), "layouts": "[1]"}
        said["last"] = await ask(client, "try_design", one)
        said["more"] = await ask(client, "try_design", {**one, "layouts": [2]})

    words = (
        *SMALL,
        "task.variation=near",
        "fitness=layouts",
        "fitness.layouts=3",
        "budget.n_rollouts=5",
        "second=[]",
        "folder=run",
    )
    converse(ask_for_less, tmp_path, *words)
    converse(go_on, tmp_path, *words)
    assert '"id": "g0-a1-s0-p0"' in text(said["one"])
    assert "one rollout taken" in text(said["one"])
    assert re.search(
        r"layout 2: \d.\d+ in pybullet, \d.\d+ in mujoco", text(said["other"])
    )
    assert "no engine 'bullet'" in text(said["none"])
    for name in ("best", "again"):
        assert "0 candidates tried, 2 rollouts taken" in text(said[name])
    assert len(pictures(said["seen"])) == 1
    assert "one candidate tried, 4 rollouts taken" in text(said["whole"])
    assert "5 rollouts taken" in text(said["last"])
    assert "Nothing was tried" in text(said["more"])


def test_the_rest_of_a_plan_costs_what_it_plays(tmp_path):
    said = {}

    async def fork(client):
        await ask(client, "try_design", {"designs": solution()})
        rest = {"candidate": "g0-a0-s0-p0", "from_waypoint": 2}
        for name, asked in {
            "on": {**rest, "change": {"action_sets.0.2.1": 0.05}},
            "otherwise": {**rest, "change": {"action_sets.0.0.1": 0.05}},
            "none": {**rest, "from_waypoint": 9},
            "elsewhere": {**rest, "engine": "pybullet"},
            "nothing": {"designs": solution(), "from_waypoint": 2},
        }.items():
            said[name] = text(await ask(client, "try_design", asked))

    converse(fork, tmp_path, *SMALL, "folder=run")
    assert "went on from waypoint 2 of g0-a0-s0-p0, at 1.3" in said["on"]
    share = float(re.search(r"1\.(\d+) rollouts taken", said["on"])[1]) / 100
    assert 0.3 < share < 0.7
    assert "played from the start" in said["otherwise"]
    assert f"{2 + share:.2f} rollouts taken" in said["otherwise"]
    assert "no waypoint 9; the plan has 3" in said["none"]
    assert "was not played in layout 0 in pybullet" in said["elsewhere"]
    assert "goes with candidate and change" in said["nothing"]


def test_progress_is_reported_and_grows(session):
    _, said = session
    seconds = [done for done, _ in said["progress"]]
    assert seconds == sorted(seconds)
    assert all(message for _, message in said["progress"])


def test_what_is_not_possible_is_refused_and_costs_nothing(session):
    _, said = session
    for name in ("early", "beyond", "faulty", "after"):
        assert said[name].is_error, name
    assert "try one first" in text(said["early"])
    assert "3 candidates, and the budget holds 2 more" in text(said["beyond"])
    assert "Nothing was tried" in text(said["faulty"])
    assert '[E_LINK_LOOSE {"name": "a", "mounts": "tool_mount"}]' in text(
        said["faulty"]
    )
    assert "come to its end" in text(said["after"])


def test_a_killed_session_goes_on_where_it_was(session):
    _, said = session
    assert said["lost"] == [(1,)]
    assert "one candidate tried, one rollout taken" in text(said["again"])
    assert json.loads(text(said["again"]).splitlines()[0])["id"] == "g0-a0-s0-p0"
    assert "2 candidates tried, 2 rollouts taken" in text(said["second"])


def test_it_is_a_run(session):
    folder, said = session
    stored = StoredRun(folder)
    assert stored.config()["evolution"]["name"] == "agent"
    evaluations = stored.evaluations(stored.trials())
    assert [e.candidate for e in evaluations] == ["g0-a0-s0-p0", "g1-a0-s0-p0"]
    assert stored.designs()[1, 0, 0].parents == ("g0-a0-s0-p0",)
    result = json.loads((folder / "result.json").read_text())
    assert result["best"]["candidate"] == "g1-a0-s0-p0"
    assert result["stopped"] is None
    assert (folder / "best" / "design.json").exists()
    assert "The winner is g1-a0-s0-p0" in text(said["finish"])
    assert text(said["finish"]) == text(said["finished"])


def test_another_run_in_the_same_folder_is_refused(session):
    folder, _ = session
    words = [word for word in PICTURES if not word.startswith("budget")]
    done = start(folder.parent, *words, "budget.n_rollouts=4")
    out, err = done.communicate(timeout=300)
    assert (done.returncode, out) == (2, b"")
    assert b"holds a run with another budget" in err


def stem(reach):
    """A stem with a probe that reaches into the cube where it is long, at the start."""
    parts = [
        ("stem", "tool_mount", [0.02, 0.02, 0.48], [0, 0, -0.24]),
        ("probe", "stem", [reach, 0.006, 0.006], [reach / 2, 0, -0.475]),
    ]
    components = [
        {
            "name": name,
            "parent": parent,
            "shape": "box",
            "size": size,
            "position": place,
            "mass": 0.03,
        }
        for name, parent, size, place in parts
    ]
    design = {"gripper": False, "tool_name": "probe", "tool_components": components}
    plan = [[0.5, 0.0, 0.6, 0.0, 0.0, 0.0]]
    return {"strategies": [{**design, "action_sets": [plan]}]}


def test_a_free_answer_is_no_ruler_and_a_paid_one_is_counted(tmp_path):
    """At pictures the same is said of a probe in the cube and of one before it; a try says it, and counts."""
    said = {}

    async def measure(client):
        for level_words, reach in (("free", 0.05), ("free", 0.55)):
            answer = await ask(client, "check_design", {"designs": stem(reach)})
            said.setdefault(level_words, set()).add(text(answer))

        far = stem(0.05)  # an answer about the arm alone
        far["strategies"][0]["action_sets"][0][-1][0] = 1.5
        said["far"] = text(await ask(client, "check_design", {"designs": far}))
        said["try"] = await ask(client, "try_design", {"designs": stem(0.55)})
        said["second"] = await ask(client, "try_design", {"designs": stem(0.55)})

    words = (
        *SMALL,
        "tool=boxes",
        "material=paper",
        "budget.n_rollouts=1",
        "folder=run",
    )
    converse(measure, tmp_path, *words, "prompt.context=pictures")
    (free,) = said["free"]
    assert "nothing found" in free
    assert re.search(r"the arm misses the way to waypoint \d+ by \d+ mm", said["far"])
    assert "starts" in text(said["try"])
    assert "0 candidates left" in text(said["try"])
    assert said["second"].is_error

    said.clear()
    (tmp_path / "told").mkdir()
    converse(measure, tmp_path / "told", *words, "prompt.context=words")
    assert len(said["free"]) == 2
    assert said["try"].is_error
    assert "nothing is counted" in text(said["try"])


def test_a_curve_is_tried_as_designs_of_the_budget(tmp_path):
    said = {}
    yaw = {"add_to": "yaw", "low": -0.3, "high": 0.3}

    async def vary(client):
        said["try"] = await ask(client, "try_design", {"designs": solution()})
        tried = {"candidate": "g0-a0-s0-p0", "axes": [yaw]}
        said["curve"] = await ask(client, "try_curve", tried)
        said["best"] = await ask(client, "best_designs", {"count": 1})
        said["beyond"] = await ask(client, "try_curve", tried)
        unknown = {**tried, "axes": [{**yaw, "component": "fin"}]}
        said["unknown"] = await ask(client, "try_curve", unknown)

    words = (*SMALL, "budget.curves=3", "budget.n_rollouts=5", "folder=run")
    converse(vary, tmp_path, *words)
    curve = text(said["curve"])
    assert "curve, added to waypoints all yaw: -0.3: " in curve
    assert "; 0: " in curve
    assert "; 0.3: " in curve
    assert "5 candidates tried" in text(said["best"])
    assert "Nothing was tried: these are 4 candidates" in text(said["beyond"])
    assert "the tool's components are" in text(said["unknown"])
    stored = StoredRun(tmp_path / "run").evaluations()
    ids = [evaluation.candidate for evaluation in stored]
    assert ids == ["g0-a0-s0-p0", *(f"g1-a0-s{number}-p0" for number in range(4))]


# --- a flood of nonsense ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong_calls", "flood_calls"),
    [(55, 1_000), pytest.param(1_000, 10_000, marks=pytest.mark.weekly)],
)
def test_nonsense_and_floods_are_answered_and_the_run_lives(
    wrong_calls, flood_calls, tmp_path
):
    documents = (None, 1, "", "{", [], {"strategies": "x"}, {"a": 1}, "[" * 5000)
    wrong = [("try_design", {"designs": document}) for document in documents]
    wrong += [("nonsense", {}), ("look", {"view": "behind"}), ("watch", {})]

    async def flood(client):
        await ask(client, "best_designs")
        for number in range(wrong_calls):
            name, given = wrong[number % len(wrong)]
            answer = await ask(client, name, given)
            assert answer.is_error, (name, given)
            if name == "nonsense":
                assert "no tool 'nonsense'; there are" in text(answer)

        # How many are refused depends on how fast they come; each is answered.
        calls = [client.call_tool("best_designs") for _ in range(flood_calls)]
        answers = await asyncio.gather(*calls)
        refused = [text(answer) for answer in answers if answer.is_error]
        assert len(refused) < flood_calls
        assert all("wait" in words for words in refused)
        return await ask(client, "best_designs")

    answer = converse(flood, tmp_path, *SMALL, "folder=run")
    assert "0 candidates tried, 0 rollouts taken" in text(answer)
