"""The search for cheats draws designs that a run would read, measures what is absurd, and gives the same again."""

import json
import sys

import numpy as np
import pytest

from tests.benchmarks import cheats


@pytest.fixture
def search(tmp_path):
    return cheats._Search(cheats.Pair("LeverStone", "pressed", cheats.engines(["mujoco"])["mujoco"], 0, 10, tmp_path))


def test_designs_have_joints_all_shapes_and_anchors(search):
    first = search.sound(search.varied.draw)
    drawn = [search.sound(lambda: search.varied.changed(first, first)) for _ in range(60)]
    sound = [candidate for candidate in drawn if candidate.problem is None]
    assert len(sound) > 40
    shapes = {type(part.shape).__name__ for candidate in sound for part in candidate.tool.components}
    assert {"Box", "Sphere", "Cylinder", "WrittenMesh"} <= shapes
    joints = {bearer.joint.kind for candidate in sound for bearer in candidate.tool.bearers}
    assert joints == {"hinge", "slider"}
    assert {step.anchor for candidate in sound for step in candidate.plan.steps} > {"world"}


def test_the_reference_solution_is_not_absurd(search):
    solution = cheats.load_designs(cheats.SOLUTIONS / "LeverStone.json")
    boxes = cheats.installed().create("tool", "boxes")
    (first,) = cheats.read_designs(solution, boxes, search.spawn, actions=search.actions)
    for measure in cheats.MEASURES.values():
        search.measure = measure
        ((evaluation, lack),) = search.tried([first])
        assert evaluation.reward > 0.9
        assert lack > 0


@pytest.mark.thorough
def test_a_small_search_gives_the_same_again_and_is_judged(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cheats, "FOUND", -1.0)
    words = ["tasks=LeverStone", "measures=still", "sims=mujoco", "rollouts=40", "workers=1"]
    said = []
    for folder in ("one", "two"):
        monkeypatch.setattr(sys, "argv", ["", "search", f"folder={tmp_path / folder}", *words])
        cheats.main()
        record = json.loads((tmp_path / folder / "searched/LeverStone.still.0.json").read_text())
        said.append({key: value for key, value in record.items() if key != "seconds"})
        assert "| LeverStone |" in capsys.readouterr().out
    assert said[0] == said[1]
    assert said[0]["absurd"] > 30
    assert np.isclose(said[0]["best"], 0.0)
