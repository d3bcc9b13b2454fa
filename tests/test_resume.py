"""A run that was cut short goes on: what was asked is not asked again, what was tried is not tried again, and it comes
to what it would have come to.
"""

import builtins
import contextlib
import json
import logging
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
import yaml
from omegaconf import OmegaConf

from core.errors import UsageError, UserError
from core.plugins import installed
from core.search import patience
from core.search.orchestration import resume, run, run_and_print, run_job
from core.store.database import FILE, LOCK
from core.trial import Where
from tests.core.run_folders import edit
from tests.support import toys
from tests.support.commands import python_m
from tests.support.disks import mount, small_files
from tests.support.kills import SETTINGS
from tests.support.rare import rare
from tests.support.runs import (
    assert_same_run,
    result_of,
    rows,
    tables,
)

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
POINTS = dict.fromkeys(SETTINGS, 2) | {"archive": 4, "ray": 1}
"""At how many moments a run of each setting is killed, unless ``KILLS`` says another number."""
OFTEN = ("archive", "ensemble", "lean", "ray")
"""What is killed thoroughly; the others are killed weekly."""


PARTS = {
    "plain": (),
    "numbers": ("prompt.feedback=numbers",),
    "archive": ("evolution=map_elites", "budget.n_iteration=2"),
    "islands": ("evolution=islands", "budget.n_iteration=2"),
    "refined": ("evolution.refine=12",),
    "tasks": ("task=multitask", "task.of=[BringCube,ElevatePlate]", "budget.n_agent=2", "budget.n_action=2"),
}  # fmt: skip
"""The words of runs with toys that are cut short."""
LIMIT = "{} replies are all there may be; {} are left without"
AWAY = (
    "the model answered no request of generation {}: service is down; requests without an answer are sent again when "
    "the run goes on; "
)
CUTS = [
    # A part, what cuts the run, what it raises (None: it ends well), what it says, what it keeps (None: it depends).
    ("plain", "vlm.limit=6", None, LIMIT.format(6, 2), "trials"),
    ("plain", "vlm.limit=3", None, LIMIT.format(3, 1), "trials"),
    ("plain", "executor.fails_at=1", None, "interrupted", "replies"),
    ("plain", "executor.fails_at=2", None, "interrupted", "trials"),
    ("plain", "executor.fails_at=4", None, "interrupted", "trials"),
    ("plain", "vlm.down=g0-.*", UserError, AWAY.format(0), "nothing"),
    ("plain", "vlm.down=g1-.*", UserError, AWAY.format(1), "trials"),
    ("plain", "vlm.down=g0-a3|g1-.*", UserError, AWAY.format(1), "trials"),
    ("plain", "saving=KeyboardInterrupt", KeyboardInterrupt, "", "trials"),
    ("plain", "saving=ZeroDivisionError", ZeroDivisionError, "", "trials"),
    ("plain", "files=80000", UserError, "can't be written: ", "nothing"),
    ("plain", "files=150000", UserError, "can't be written: ", None),
    ("plain", "files=250000", UserError, "can't be written: ", None),
    ("plain", "disk=500k", UserError, "can't be written: ", None),
    ("plain", "disk=600k", UserError, "can't be written: ", None),
    ("plain", "disk=800k", UserError, "can't be written: ", None),
    ("numbers", "executor.fails_at=4", None, "interrupted", "trials"),
    ("archive", "executor.fails_at=2", None, "interrupted", "trials"),
    ("archive", "executor.fails_at=4", None, "interrupted", "trials"),
    ("archive", "executor.fails_at=6", None, "interrupted", "trials"),
    ("archive", "vlm.limit=9", None, LIMIT.format(9, 3), "trials"),
    ("islands", "executor.fails_at=5", None, "interrupted", "trials"),
    ("islands", "vlm.down=g2-.*", UserError, AWAY.format(2), "trials"),
    ("refined", "executor.fails_at=6", None, "interrupted", "trials"),
    ("tasks", "executor.fails_at=2", None, "interrupted", "trials"),
    ("tasks", "vlm.limit=4", None, LIMIT.format(4, 2), "trials"),
]  # fmt: skip
QUICK = [
    ("plain", "executor.fails_at=2"),
    ("plain", "vlm.down=g0-a3|g1-.*"),
    ("plain", "saving=KeyboardInterrupt"),
    ("plain", "disk=600k"),
    ("islands", "executor.fails_at=5"),
]


@pytest.fixture(scope="module")
def wholes(tmp_path_factory):
    """Make runs with toys that nothing happened to, each of them once."""
    parent = tmp_path_factory.mktemp("wholes")

    def make(part):
        folder = parent / part
        if not folder.exists():
            run(toys.config(parent / f"{part} notes", *PARTS[part]), folder)
        return folder

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(installed(), "offers", dict(installed().offers))
        toys.offer(installed())
        yield make


@pytest.fixture
def whole(wholes):
    return wholes("plain")


@contextlib.contextmanager
def cutting(cfg, cut, disk):
    """Let a run be cut short: by a setting, by what the disk takes, or by what is raised as its best is saved."""
    what, _, value = cut.partition("=")
    with contextlib.ExitStack() as ended:
        if what == "files":  # as a quota does
            ended.enter_context(small_files(int(value)))
        elif what == "disk":
            mount("-t", "tmpfs", "-o", f"size={value}", "toys", str(disk))
            ended.callback(mount, "-o", "remount,size=50m", str(disk))
        elif what == "saving":
            patched = ended.enter_context(pytest.MonkeyPatch.context())
            error = {"side_effect": getattr(builtins, value)}
            patched.setattr("plugins.results.best.save_design", Mock(**error))
        else:
            OmegaConf.update(cfg, what, yaml.safe_load(value), force_add=True)
        yield


@pytest.mark.parametrize(
    ("part", "cut", "error", "said", "kept"),
    rare(CUTS, *(row for row in CUTS if row[:2] in QUICK)),
)
def test_a_run_that_was_cut_says_how_to_go_on_and_comes_to_the_same_end(
    toy, wholes, disk, part, cut, error, said, kept
):
    folder = disk / "a run"
    cfg = toys.config(toy.file, *PARTS[part])
    with cutting(cfg, cut, disk):
        if error is None:
            assert run(cfg, folder).stopped == result_of(folder)["stopped"] == said
        else:
            with pytest.raises(error) as caught:
                run(cfg, folder)
            words = [str(caught.value), *getattr(caught.value, "__notes__", ())][-1]
            assert said in words
            assert "\n" not in words
            assert words.endswith(f"to go on: python -m core.run resume='{folder}'")

    known = what_is_stored(folder)
    kinds = {line.partition(" ")[0] for line in known}
    stands = "trials" if "tried" in kinds else "replies" if kinds else "nothing"
    assert kept in (stands, None)
    if part != "tasks":  # no tool has done all of them yet
        assert (folder / "best").exists() == (error is None and stands == "trials")
    assert known <= set(noted(toy))

    toy.add("session")
    lifted = {"vlm": "vlm.limit=null vlm.down=''", "executor": "executor.fails_at=null"}
    resume(folder, lifted.get(cut.partition(".")[0], "").split())
    assert_same_run(folder, wholes(part))
    again = noted(toy)[noted(toy).index("session") :]
    assert not known & set(again)


def noted(toy):
    """What was asked and tried, in order."""
    return toy.file.read_text().splitlines() if toy.file.exists() else []


# --- killed at any moment ---------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("setting", rare(POINTS, *OFTEN, mark="weekly"))
def test_a_run_killed_at_any_moment_comes_to_the_same_end_and_repeats_nothing(
    setting, tmp_path
):
    points = int(os.environ.get("KILLS", POINTS[setting]))
    words = [str(tmp_path), str(points), setting]
    command = [sys.executable, "-m", "tests.support.kills", *words]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=3600
    )
    assert done.returncode == 0, done.stderr
    whole = result_of(tmp_path / "whole" / "run")
    assert len(whole["generations"]) > 1
    if "sim=mujoco" not in SETTINGS[setting]:
        assert whole["best"]["generation"] >= 1
    noted = set((tmp_path / "whole" / "notes").read_text().split("\n"))
    assert what_is_stored(tmp_path / "whole" / "run") <= noted

    stored = []
    for point in range(points):
        at = tmp_path / str(point)
        assert_same_run(at / "run", tmp_path / "whole" / "run")
        first, *later = (
            (at / "notes").read_text().removeprefix("session\n").split("session\n")
        )
        known = what_is_stored(at / "killed")
        assert known <= set(first.split("\n"))
        assert not known & set("".join(later).split("\n"))
        stored.append(len(known))

    assert stored == sorted(stored)
    # The moments are spread over the run's life.
    assert len(set(stored)) > min(points, 25) / 3
    if "fitness.layouts=3" in SETTINGS[setting] and points >= 12:
        within = [stands_between_layouts(tmp_path / str(n)) for n in range(points)]
        assert any(within)


def stands_between_layouts(at):
    """Whether a kill left a design with trials in some of its layouts, but not in all."""
    if not what_is_stored(at / "killed"):
        return False
    count = "SELECT count(*) FROM trials GROUP BY content, task"
    layouts = max(rows(at / "run" / FILE, count))
    return any(tried < layouts for tried in rows(at / "killed" / FILE, count))


def what_is_stored(folder):
    """As lines of the toys' notes."""
    if not (folder / FILE).exists() or not rows(
        folder / FILE, "SELECT name FROM sqlite_master"
    ):
        return set()
    answered = "SELECT request_id FROM replies WHERE NOT unanswered"
    replies = rows(folder / FILE, answered)
    trials = rows(
        folder / FILE, "SELECT content, task, engine, layout, change FROM trials"
    )
    tried = {f"tried {content} {Where(*where)}" for content, *where in trials}
    return {f"asked {request}" for (request,) in replies} | tried


# --- what no reader takes ---------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("seed", 10**38, "seed must be from 0 to 9007199254740992, got 10"),
        (
            "evolution.tie",
            1e10,
            "evolution.tie: must be less than or equal to 1, got 10000000000",
        ),
        ("budget.reward_save", float("nan"), "budget: a number in it is not finite"),
        (
            "sampling.temperature",
            float("inf"),
            "sampling: a number in it is not finite",
        ),
    ],
)
def test_a_setting_that_no_reader_takes_is_refused_before_the_run_begins(
    toy, tmp_path, key, value, said
):
    cfg = toys.config(toy.file)
    OmegaConf.update(cfg, key, value)
    with pytest.raises(UserError, match=said):
        run(cfg, tmp_path / "run")
    assert toy.lines("asked") == []
    run(toys.config(toy.file), tmp_path / "run")  # the folder is free


@pytest.mark.parametrize("value", ["1e16", "0.5"])
def test_a_setting_that_no_reader_takes_leaves_a_run_to_go_on_as_it_was(
    toy, tmp_path, value
):
    folder = tmp_path / "run"
    begin(toy, folder)
    before = tables(folder)
    with pytest.raises(UserError) as error:
        resume(folder, [f"budget.n_iteration={value}"])
    assert "n_iteration" in str(error.value)
    assert "\n" not in str(error.value)
    assert tables(folder) == before


# --- limits, failures, interrupts -------------------------------------------------------------------------------


def begin(toy, folder, **settings):
    """A run that is cut short by the settings of the toys."""
    cfg = toys.config(toy.file)
    for name, value in settings.items():
        kind, _, setting = name.partition("_")
        OmegaConf.update(cfg, f"{kind}.{setting}", value, force_add=True)
    return run(cfg, folder)


@pytest.mark.thorough
def test_a_run_that_goes_on_to_the_same_limit_asks_nothing_and_says_it_again(
    toy, tmp_path, capsys
):
    folder = tmp_path / "run"
    result = begin(toy, folder, vlm_limit=6)
    generations = result_of(folder)["generations"]
    assert [found["n_candidates"] for found in generations] == [14, 7]
    resume(folder)
    assert len(toy.lines("asked")) == 6
    said = capsys.readouterr()
    assert said.out.splitlines()[-1] == str(folder / "best")
    assert said.err.splitlines() == [
        f"{folder} goes on: 6 replies and 21 evaluated candidates are there",
        f"stopped: {result.stopped}",
        f"to go on: python -m core.run resume={folder}",
    ]


@pytest.mark.thorough
def test_a_run_that_goes_on_says_again_what_stops_it(toy, tmp_path, capsys):
    folder = tmp_path / "a run"
    with pytest.raises(UserError):
        begin(toy, folder, vlm_down="g1-.*")
    with pytest.raises(UserError, match="no request of generation 1"):
        resume(folder)
    assert "requests without an answer are sent again" in capsys.readouterr().err
    hint = rf"^to go on: python -m core.run resume='{folder}'$"
    with pytest.raises(KeyboardInterrupt, match=hint):
        resume(folder, ["vlm.down=''", "executor.fails_at=1"])


@pytest.mark.thorough
def test_what_a_service_did_not_answer_stays_once_the_next_generation_builds_on_it(
    toy, tmp_path
):
    folder = tmp_path / "run"
    begin(toy, folder, vlm_down="g0-a3", vlm_limit=6)
    assert rows(folder / FILE, "SELECT request_id FROM replies WHERE unanswered") == [
        ("g0-a3",)
    ]
    before = result_of(folder)["generations"][0]
    resume(folder, ["vlm.down=''", "vlm.limit=null"])
    assert "g0-a3" not in toy.lines("asked")
    assert result_of(folder)["generations"][0] == before
    asked = len(toy.lines("asked"))
    resume(folder)  # at its end
    assert len(toy.lines("asked")) == asked == 7


def test_a_run_in_which_every_proposal_fails_ends(toy, tmp_path, capsys):
    folder = tmp_path / "run"
    cfg = toys.config(toy.file, "budget.n_agent=3", "budget.n_tool=1")
    OmegaConf.update(cfg, "vlm.only_agent", 2, force_add=True)
    run(cfg, folder)
    with pytest.raises(UserError, match="no candidate could be tried"):
        resume(folder)
    assert result_of(folder)["best"] is None


# --- what may change --------------------------------------------------------------------------------------------


def test_a_run_that_has_come_to_its_end_says_so(toy, tmp_path, capsys):
    folder = tmp_path / "run"
    begin(toy, folder)
    before, asked = tables(folder), toy.lines("asked")
    best = result_of(folder)["best"]
    distance = best["measured"]["distance_m"]
    for overrides in ([], ["executor.notes=elsewhere", "film=true"]):
        resume(folder, overrides)
        said = capsys.readouterr().out.splitlines()
        assert said == [
            f"{folder} holds a run that has come to its end",
            f"best reward {best['reward']:.3f}, distance {distance:.2f} m, candidate {best['candidate']}",
            str(folder / "best"),
        ]
    assert (tables(folder), toy.lines("asked")) == (before, asked)


def test_a_job_of_a_sweep_goes_on_where_it_was_begun(toy, tmp_path, whole, capsys):
    folder = tmp_path / "run"
    begin(toy, folder, vlm_limit=6)
    run_job(toys.config(toy.file), folder)
    assert f"{folder} goes on: " in capsys.readouterr().err
    assert len(toy.lines("asked")) == 8
    assert_same_run(folder, whole)

    run_job(toys.config(toy.file), folder)
    assert "holds a run that has come to its end" in capsys.readouterr().out
    with pytest.raises(UserError, match=r"holds a run with another budget.n_agent;"):
        run_job(toys.config(toy.file, "budget.n_agent=3"), folder)
    assert len(toy.lines("asked")) == 8


def test_more_generations_can_be_asked_for(toy, tmp_path):
    whole, folder = tmp_path / "whole", tmp_path / "run"
    run(toys.config(tmp_path / "other notes", "budget.n_iteration=2"), whole)
    begin(toy, folder)
    resume(folder, ["budget.n_iteration=2"])
    assert len(toy.lines("asked")) == 12
    assert_same_run(folder, whole)
    with pytest.raises(
        UsageError, match=r"budget\.n_iteration .* can only be raised; it is 2"
    ):
        resume(folder, ["budget.n_iteration=1"])


def test_a_reward_that_ends_runs_takes_no_tried_candidate_away(toy, tmp_path, capsys):
    folder = tmp_path / "run"
    begin(toy, folder)
    before = result_of(folder)
    first = before["generations"][0]["best_reward"]
    assert len(before["generations"]) > 1

    resume(folder, [f"budget.stop_reward={first}"])
    after = result_of(folder)
    assert "generations in which something was tried stay" in capsys.readouterr().err
    assert after["best"] == before["best"]
    assert after["generations"] == before["generations"]
    assert after["n_evaluations"] == before["n_evaluations"]


@pytest.mark.thorough
def test_a_run_that_had_ended_and_was_killed_while_it_went_on_has_not_ended(
    toy, tmp_path, monkeypatch
):
    """A resume of ShinkaEvolve (#98) believed itself finished."""
    whole, folder = tmp_path / "whole", tmp_path / "run"
    run(toys.config(tmp_path / "other notes", "budget.n_iteration=2"), whole)
    begin(toy, folder)
    with monkeypatch.context() as patched:
        # Nothing after this is written.
        patched.setattr("plugins.results.best.save_design", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            resume(folder, ["budget.n_iteration=2"])
    resume(folder)
    assert len(toy.lines("asked")) == 12
    assert_same_run(folder, whole)


def test_a_changed_prompt_is_reported_and_the_replies_are_kept(toy, tmp_path, caplog):
    folder = tmp_path / "run"
    begin(toy, folder, vlm_limit=6)
    edit(folder, "UPDATE requests SET digest = 'of another prompt'")
    with caplog.at_level(logging.WARNING):
        resume(folder, ["vlm.limit=100"])
    said = [message for message in caplog.messages if "composed differently" in message]
    assert len(said) == 6  # the two without a reply are simply asked as they are now
    assert sorted(toy.lines("asked")) == [
        f"g{g}-a{a}" for g in range(2) for a in range(4)
    ]


def test_changed_versions_are_reported(toy, tmp_path, caplog):
    folder = tmp_path / "run"
    begin(toy, folder, vlm_limit=6)
    ((versions,),) = rows(folder / FILE, "SELECT versions FROM sessions")
    changed = json.dumps(json.loads(versions) | {"numpy": "0.9", "abacus": "1.0"})
    edit(folder, "UPDATE sessions SET versions = ?", changed)
    with caplog.at_level(logging.WARNING):
        resume(folder, ["vlm.limit=100"])
    (said,) = caplog.messages
    assert "abacus 1.0 -> None, numpy 0.9 -> " in said


def test_a_candidate_that_reads_differently_now_is_not_given_another_ones_reward(
    toy, tmp_path
):
    folder = tmp_path / "run"
    begin(toy, folder, vlm_limit=6)
    edit(
        folder,
        "UPDATE evaluations SET content = 'other' WHERE candidate = 'g0-a0-s0-p1'",
    )
    with pytest.raises(
        UserError,
        match=f"g0-a0-s0-p1 reads differently now .* vlm=replay vlm.run={folder}",
    ):
        resume(folder, ["vlm.limit=100"])


# --- where there is nothing to go on with -----------------------------------------------------------------------


def test_folders_without_a_run(toy, tmp_path):
    with pytest.raises(
        UserError, match=r"nowhere holds no run that has begun; start one$"
    ):
        resume(tmp_path / "nowhere")
    begin(toy, tmp_path / "sweep" / "0_seed=5")
    with pytest.raises(
        UserError,
        match=r"sweep holds no run that has begun; there is one in .*sweep/0_seed=5$",
    ):
        resume(tmp_path / "sweep")
    assert not (tmp_path / "sweep" / LOCK).exists()


def test_a_run_killed_before_it_stored_anything_is_started_again(toy, whole, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / FILE).write_bytes(b"")
    with pytest.raises(UserError, match=r"holds no run that has begun; start one$"):
        resume(tmp_path / "run")
    begin(toy, tmp_path / "run")
    assert_same_run(tmp_path / "run", whole)


# --- one process at a time --------------------------------------------------------------------------------------


def test_a_second_process_is_refused_and_the_first_goes_on(toy, whole, tmp_path):
    folder = tmp_path / "run"
    begin(toy, folder, vlm_limit=3)
    code = "import sys; from core.store.recorder import RunStore; from pathlib import Path; "
    code += "s = RunStore.open(Path(sys.argv[1]))"
    hold = f"{code}; print('held', flush=True); sys.stdin.read()"
    command = [sys.executable, "-c", hold, str(folder)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(
            UserError, match=f"another process is at work on the run in {folder}"
        ):
            resume(folder)
        other.kill()  # its lock dies with it
        other.wait()
    resume(folder, ["vlm.limit=100"])
    assert_same_run(folder, whole)


# --- disks ------------------------------------------------------------------------------------------------------


def test_a_disk_with_room_for_nothing(disk):
    mount("-t", "tmpfs", "-o", "size=8k", "toys", str(disk))
    done = python_m(
        disk,
        "core.run",
        "task=BringCube",
        "vlm=offline",
        f"hydra.run.dir={disk / 'run'}",
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert (
        done.stderr
        == "error: can't write the run's folder, or the output: No space left on device\n"
    )


@pytest.mark.parametrize("begun", [False, True])
def test_a_folder_that_cannot_be_written(toy, disk, begun):
    mount("-t", "tmpfs", "-o", "size=50m", "toys", str(disk))
    if begun:
        begin(toy, disk / "run", vlm_limit=3)
    mount("-o", "remount,ro", str(disk))
    with pytest.raises(
        UserError,
        match=r"can't be written: Read-only file system; what is in it is kept$",
    ):
        resume(disk / "run") if begun else begin(toy, disk / "run")


# --- patience ---------------------------------------------------------------------------------------------------


@pytest.fixture
def waits(monkeypatch):
    """Seconds that were waited. Nothing waits really; what is put into ``then`` is done at the wait of that number."""
    waited = []
    waited_then = {}

    def sleep(seconds):
        waited.append(seconds)
        waited_then.get(len(waited), lambda: None)()

    monkeypatch.setattr(patience, "time", SimpleNamespace(sleep=sleep))
    return waited, waited_then


def patient(toy, patience_s, **settings):
    cfg = toys.config(toy.file)
    for name, value in {"patience_s": patience_s, **settings}.items():
        OmegaConf.update(cfg, name.replace("__", "."), value, force_add=True)
    return cfg


def test_a_run_waits_for_room_and_comes_to_the_same(toy, whole, disk, waits, capsys):
    mount("-t", "tmpfs", "-o", "size=600k", "toys", str(disk))
    waited, then = waits
    then[2] = lambda: mount("-o", "remount,size=50m", str(disk))
    run_and_print(patient(toy, 30), disk / "run")
    assert waited == [10, 20]
    said = [line for line in capsys.readouterr().err.splitlines() if "may pass" in line]
    assert len(said) == 2
    assert "the run goes on by itself in 20 s, and gives up after 20 s" in said[1]
    assert_same_run(disk / "run", whole)


def test_a_run_gives_up_when_its_patience_is_at_an_end(toy, disk, waits):
    mount("-t", "tmpfs", "-o", "size=600k", "toys", str(disk))
    waited, then = waits
    then[3] = lambda: mount("-o", "remount,size=50m", str(disk))
    with pytest.raises(UserError, match="can't be written"):
        run_and_print(patient(toy, 29), disk / "run")
    assert waited == [10, 19]


@pytest.mark.thorough
def test_a_run_waits_for_a_model_that_is_away_and_pays_nothing_twice(
    toy, whole, tmp_path, waits, capsys
):
    cfg = patient(toy, 3600, vlm__down="g1-.*")
    waited, then = waits
    then[12] = lambda: OmegaConf.update(cfg, "vlm.down", "")
    run_and_print(cfg, tmp_path / "run")
    assert waited[:7] == [10, 20, 40, 80, 160, 300, 300]
    assert len(waited) == 12
    assert "the model answered no request of generation 1" in capsys.readouterr().err
    assert_same_run(tmp_path / "run", whole)


def test_ctrl_c_ends_a_wait_and_says_how_to_go_on(toy, tmp_path, monkeypatch):
    def interrupt(seconds):
        raise KeyboardInterrupt

    monkeypatch.setattr(patience, "time", SimpleNamespace(sleep=interrupt))
    with pytest.raises(KeyboardInterrupt, match=f"resume={tmp_path / 'run'}"):
        run_and_print(patient(toy, 60, vlm__down="g1-.*"), tmp_path / "run")


def test_what_does_not_pass_is_not_waited_for(toy, disk, waits):
    mount("-t", "tmpfs", "-o", "size=50m", "toys", str(disk))
    begin(toy, disk / "run", vlm_limit=3)
    mount("-o", "remount,ro", str(disk))
    with pytest.raises(UserError, match="Read-only"):
        resume(disk / "run", ["patience_s=3600"])
    assert waits[0] == []


def test_a_patience_below_zero_is_refused(toy, tmp_path):
    with pytest.raises(UsageError, match="patience_s must be 0 or greater, got -1"):
        run_and_print(patient(toy, -1), tmp_path / "run")
