"""What a run saves is what was tried: chaotic scenes go the same way again, to the bit."""

import shutil
from pathlib import Path

import pytest

from core.designs.reading import load_designs, read_designs
from core.interfaces import RolloutSettings
from core.plugins import installed
from plugins.results.artifacts import save_design
from tests.support.engines import simulator
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch

HERE = Path(__file__).parent


@pytest.mark.slow
@pytest.mark.parametrize("name", ["scenes/UseFunnel", "small/cloth_on_table"])
def test_a_saved_design_plays_again_to_the_bit(name, tmp_path):
    """Numbers such as 3.14159265359 stay as they were written."""
    task = on_panda(installed().create("task", "file", file=f"{HERE / name}.yaml"))
    tools = installed().create("tool", "boxes")
    shutil.copy(f"{HERE / name}.json", tmp_path / "design.json")
    ends = []
    for _ in range(2):
        document = load_designs(tmp_path / "design.json")
        (design,) = read_designs(document, tools, task)
        settings = RolloutSettings()
        (found,) = evaluate_batch(
            task, simulator("mujoco"), [design], settings=settings
        )
        assert found.reward > 0.1
        ends.append((found.reward, found.trials[0].moved_m))
        save_design(design, tools, tmp_path)
    assert ends[0] == ends[1]
