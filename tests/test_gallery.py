"""The gallery shows what its designs earn, and its pictures are small and there."""

import json
import re
from pathlib import Path

import pytest
from PIL import Image

from core.simulation.play import play
from docs import gallery
from tests.support.rare import rare

FIGURES = json.loads(gallery.FIGURES.read_text("utf-8"))
DESIGNS = [
    entry
    for task in sorted(FIGURES)
    for entry in gallery.entries(task)
    if entry.designer in gallery.ROUNDS
]


def test_the_page_says_what_was_measured():
    _, made, _ = gallery.split_page(gallery.PAGE.read_text("utf-8"))
    assert made.strip() == gallery.page_part(FIGURES).strip()
    assert len(FIGURES) == 12


def test_pictures_are_there_and_take_little_room():
    page = gallery.PAGE.read_text("utf-8")
    shown = {Path(name).name for name in re.findall(r"images/gallery/([\w.]+)", page)}
    files = {file.name: file for file in gallery.PICTURES.iterdir()}
    assert shown | {"strip.webp"} == set(files)
    assert sum(file.stat().st_size for file in files.values()) <= 6_000_000

    for task in FIGURES:
        with Image.open(files[f"{task}.webp"]) as film:
            assert film.size == (640, 480)
            assert film.is_animated


@pytest.mark.thorough
@pytest.mark.parametrize("engine", rare(gallery.ENGINES, "mujoco", mark="weekly"))
@pytest.mark.parametrize(
    "entry", DESIGNS, ids=lambda entry: f"{entry.task}-{entry.designer}"
)
def test_a_design_earns_again_what_the_page_says(entry, engine):
    (trial,) = play(entry.condition(engine), [entry.read()])
    told = FIGURES[entry.task][entry.designer]["rewards"][engine]
    assert trial.reward == pytest.approx(told, abs=0.02)
