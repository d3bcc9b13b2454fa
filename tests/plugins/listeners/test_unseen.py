"""Films of unseen layouts in which the best design fails, and what the run says of them."""

import json
from pathlib import Path

import pytest

from core.config.compose import load
from core.errors import UsageError
from core.search.orchestration import run

SOLUTION = Path(__file__).parents[2] / "tasks/solutions/BringCube.json"
RUN = (
    "task=BringCube task.variation=wide sim=mujoco fitness=layouts fitness.layouts=1 fitness.unseen=3 budget.final_s=0 "
    "budget.elite_s=0 budget.n_agent=1 budget.n_tool=1 budget.n_action=1 budget.n_iteration=0 prompt.picture=false "
    "vlm=mailbox vlm.poll_s=0.02 listener=[unseen,summary] listener.unseen.films=1"
)


@pytest.mark.weekly
@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_failing_unseen_layouts_are_named_and_filmed(tmp_path, capsys):
    letter = tmp_path / "box/g0-a0"
    letter.mkdir(parents=True)
    (letter / "reply.json").write_text(SOLUTION.read_text())
    words = [*RUN.split(), f"vlm.folder={letter.parent}"]
    folder = tmp_path / "run"
    run(load("config", words), folder)

    failed = json.loads((folder / "result.json").read_text())["unseen"]["failed"]
    worst, *others = failed
    assert worst["cause"]
    assert set(worst["draw"]) >= {"cube.x", "cube.y"}
    assert (folder / worst["film"]).read_bytes().startswith(b"GIF89a")
    assert [layout["film"] for layout in others] == [""] * len(others)

    said = capsys.readouterr().err
    heading = f"unseen layouts in which the best fails ({len(failed)} of 3), and why:"
    _, _, named = said.partition(heading)
    line = f"layout {worst['layout']}, mujoco: reward 0."
    assert named.strip().startswith(line)
    assert worst["film"] in named


def test_an_idea_that_nobody_reads_is_refused(tmp_path):
    idea = tmp_path / "idea.md"
    idea.write_text("Use a long hook.")
    words = ["prompt=human", f"prompt.file={idea}", "vlm=offline"]
    with pytest.raises(UsageError, match="reads no text, so "):
        run(load("config", words), tmp_path / "run")


@pytest.mark.thorough
@pytest.mark.usefixtures("inline")
def test_settings_that_nothing_reads_are_said(tmp_path, capsys):
    words = "prompt=paper prompt.critic=2 sampling.spread=0 sim=mujoco film=false listener={} "
    words += "budget.n_agent=1 budget.n_tool=1 budget.n_action=1 budget.n_iteration=0"
    run(load("config", words.split()), tmp_path / "run")
    assert (
        "change nothing: prompt=paper prompt.feedback=paper prompt.critic=2 sampling.spread=0"
        in capsys.readouterr().err
    )
