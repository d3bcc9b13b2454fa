"""The tasks without code: each has a reference solution that every engine agrees on."""

from pathlib import Path

import pytest

from core.designs.reading import load_designs, read_designs
from core.errors import UserError
from core.plugins import installed
from tests.support.engines import every_simulator, simulator
from tests.support.playing import evaluate_batch
from tests.support.text import replaced_all

ROOT = Path(__file__).parents[2]
SCENES = sorted((ROOT / "tasks/scenes").glob("*.yaml"))
every_scene = pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.stem)


def tried(scene, engine, variation="none", seeds=(0,)):
    """What the reference solution earns in some layouts."""
    task = installed().create("task", "file", file=str(scene), variation=variation)
    designs = load_designs(ROOT / "tests/tasks/scenes" / f"{scene.stem}.json")
    boxes = installed().create("tool", "boxes")
    return [
        evaluate_batch(
            task,
            simulator(engine),
            read_designs(designs, boxes, task),
            seed,
        )[0]
        for seed in seeds
    ]


@every_simulator
@every_scene
def test_the_reference_solution_earns_all(scene, engine):
    if scene.stem == "turn_hose" and engine != "mujoco":
        with pytest.raises(
            UserError,
            match=rf"sim={engine} does not support soft bodies \(hose\); use sim=mujoco",
        ):
            tried(scene, engine)
        return
    (found,) = tried(scene, engine)
    assert found.status == "ok", found.reason
    assert found.solved
    assert not found.warnings


@pytest.mark.thorough
@pytest.mark.slow
@every_scene
def test_it_fits_other_layouts(scene):
    for found in tried(scene, "mujoco", "wide", range(5)):
        assert found.reward >= 0.95, found.reason


def test_the_glass_must_stay_untouched(tmp_path):
    """The same motion earns nothing where the glass stands in its way."""
    text = (ROOT / "tasks/scenes/turn_valve.yaml").read_text()
    moved = replaced_all(text, ("[0.68, -0.1, 0.0701]", "[0.66, -0.065, 0.0701]"))
    scene = tmp_path / "turn_valve.yaml"
    scene.write_text(moved)
    (found,) = tried(scene, "mujoco")
    assert (found.status, found.reward) == ("ok", 0.0)
