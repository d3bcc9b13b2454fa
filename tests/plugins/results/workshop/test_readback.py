"""The tool that is made of written files: the same shapes, and a verdict where the files have others."""

import json

import numpy as np
import pytest
import trimesh

from core.interfaces import Material
from plugins.conformance.joints import tongs
from plugins.results.workshop.readback import check_files, read_back
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.tool import make_tool, write_tool
from tests.panda import PANDA
from tests.plugins.results.workshop.test_tool import LONG, PLA


def written(folder, tool, material=PLA):
    made = make_tool(material.made(tool), PANDA, material, Printer(), Fit())
    write_tool(made, folder)
    return made


def bounds(tool):
    corners = {c.name: tool.placed()[c.name][1].apply(p.vertices) for c in tool.components for p in c.shape.parts}
    return {name: np.array([of.min(axis=0), of.max(axis=0)]) for name, of in corners.items()}


def earned(engine, tool):
    """A reward that falls by 0.01 for each millimetre by which the tip is elsewhere."""
    return 1.0 - 10 * float(np.abs(bounds(tool)["tip"] - [[0.39, -0.01, -0.2], [0.41, 0.01, -0.1]]).max())


def test_files_of_two_parts_make_the_tool_again(tmp_path):
    made = written(tmp_path, LONG)
    tool, filled, _ = read_back(made, tmp_path)
    assert [c.mass for c in tool.components] == [c.mass for c in made.mounted.components]
    of, parts = bounds(tool), {c.name: c.shape.parts for c in tool.components}
    assert of["beam"] == pytest.approx(np.array([[-0.02, -0.015, -0.11], [0.42, 0.015, -0.09]]), abs=2e-4)
    assert len(parts["beam"]) == 1  # it was cut in two
    assert max(p.vertices[:, 2].max() + z for p in parts["post"] for z in [-0.05]) == pytest.approx(0.003, abs=2e-4)
    assert 2 < filled <= 3.4  # the bores, 6.6 mm wide
    check, rewards = check_files(made, tmp_path, {"one": 0.99}, earned)
    assert check.passed
    assert check.found.startswith(f"it earns {rewards['one']:.3f} for 0.990 in one; shapes")


def test_other_files_fail(tmp_path):
    made = written(tmp_path, LONG)
    file = tmp_path / "part_2_of_2.stl"
    mesh = trimesh.load_mesh(file)
    mesh.apply_scale(1.05).export(file)  # 5 % of some 220 mm
    check, _ = check_files(made, tmp_path, {"one": 0.99}, earned)
    assert not check.passed
    figures = json.loads((tmp_path / "print.json").read_text())
    figures["parts"][1]["to_mount"][2][3] -= 500
    (tmp_path / "print.json").write_text(json.dumps(figures))
    check, rewards = check_files(made, tmp_path, {"one": 0.99}, earned)
    assert (check.passed, rewards) == (False, {})
    assert "component tip is not in the files" in check.found
    file.write_bytes(trimesh.Trimesh(mesh.vertices, mesh.faces[1:]).export(file_type="stl"))
    assert "part_2_of_2.stl is not a closed solid" in check_files(made, tmp_path, {"one": 0.99}, earned)[0].found


def test_what_joints_move_is_read_from_its_own_file(tmp_path):
    made = written(tmp_path, tongs(), Material())
    tool, *_ = read_back(made, tmp_path)
    before = {c.name: c.shape.bounds for c in made.mounted.components}
    for component in tool.components:
        found = np.vstack([part.vertices for part in component.shape.parts])
        if component.name != "bar":  # which has the boss
            middle, size = before[component.name]
            assert np.abs(found - middle).max(axis=0) == pytest.approx(size / 2, abs=6e-4)
    assert [c.joint for c in tool.components] == [c.joint for c in made.mounted.components]
