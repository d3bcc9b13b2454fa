"""What tools weigh, from the material's data to a whole run."""

import json
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from core.config.compose import load, tool_part
from core.design import Component, Tool
from core.errors import UsageError, UserError
from core.geometry import Box, Capsule, Cylinder, Mesh, Pose, Sphere
from core.search.orchestration import run
from core.values.materials import PAPER, Material
from plugins.results.pages.best_tool import best_tool
from plugins.results.pages.runs import read_run
from plugins.results.transfer import configured

pytestmark = pytest.mark.slow

PLA = Material("pla", 1240, 0.2, 1.2, 0.5, 2.5e9, 26e6)
SHAPES = [Box((0.02, 0.03, 0.1)), Sphere(0.02), Cylinder(0.01, 0.1), Capsule(0.01, 0.1)]
SHAPES += [Mesh.from_trimesh(Box((0.02, 0.03, 0.1)).to_trimesh())]


def material_of(*words):
    return tool_part(load("evaluate", ["task=BringCube", *words])).create().material


def test_a_box_is_weighed_by_its_walls_and_infill():
    """A cube of 20 mm with walls of 2 mm: 8000 mm^3, of which 16^3 are inside."""
    cube = Box((0.02, 0.02, 0.02))
    assert Material("m", 1000, 0.25, 2.0).volume_of(cube) == pytest.approx(
        (8000 - 0.75 * 4096) * 1e-9
    )
    assert Material("m", 1000).volume_of(cube) == pytest.approx(8e-6)
    # All wall.
    assert Material("m", 1000, 0.25, 10.0).volume_of(cube) == pytest.approx(8e-6)
    tool = Tool((Component("a", "tool_mount", Pose(), cube, 0.9),))
    assert Material("m", 1000).made(tool).mass == pytest.approx(0.008)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
@given(infill=st.floats(0.01, 1), wall_mm=st.floats(0, 50))
def test_no_component_weighs_more_than_solid_or_less_than_its_infill(
    shape, infill, wall_mm
):
    volume = Material("m", 1000, infill, wall_mm).volume_of(shape)
    assert infill * shape.volume * (1 - 1e-9) <= volume <= shape.volume * (1 + 1e-9)


def test_paper_leaves_a_tool_as_it_is():
    tool = Tool(
        (Component("a", "tool_mount", Pose(), Box((0.1, 0.1, 0.1))),), friction=0.9
    )
    assert PAPER.made(tool) is tool
    made = PLA.made(tool)
    assert (made.friction, made.mass) == (
        0.5,
        pytest.approx(1240 * (1e-3 - 0.8 * 0.0976**3)),
    )
    assert replace(PAPER, friction=0.2).made(tool) == replace(tool, friction=0.2)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["material=wood"], "no material 'wood'; possible: abs, "),
        (
            ["material=pla", "material.density_kg_m3=-5"],
            "material.density_kg_m3 must be greater than 0, got -5",
        ),
        (
            ["material=pla", "material.density_kg_m3=inf"],
            "material.density_kg_m3 must be greater than 0, got inf",
        ),
        (
            ["material=pla", "material.young_pa=0"],
            "material.young_pa must be greater than 0, got 0",
        ),
        (
            ["material=pla", "material.strength_pa=nan"],
            "material.strength_pa must be greater than 0, got nan",
        ),
        (
            ["material=pla", "material.infill=2"],
            "material.infill is a share, 0.01 to 1, got 2",
        ),
        (
            ["material=pla", "material.infill=0"],
            "material.infill is a share, 0.01 to 1, got 0",
        ),
        (
            ["material=pla", "material.wall_mm=-1"],
            "material.wall_mm must be 0 or greater, and finite, got -1",
        ),
        (
            ["material.friction=-0.1"],
            "material.friction must be 0 or greater, and finite, got -0.1",
        ),
        (
            ["material=pla", "material.infill=lots"],
            "Error merging override material.infill=lots: Value 'lots' ",
        ),
        (
            ["material=pla", "material.colour=red"],
            "no key 'colour' in material; possible: density_kg_m3, friction, ",
        ),
    ],
)
def test_hostile_settings_get_one_line(words, reason):
    with pytest.raises(UsageError) as error:
        material_of(*words)
    assert str(error.value).startswith(reason)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "stored",
    ["pla", [1], {"name": "pla", "mass": 3}, {"infill": "much"}, {"infill": 7}],
)
def test_a_stored_material_that_is_none_gets_one_line(stored):
    with pytest.raises(UserError, match="material") as error:
        tool_part(OmegaConf.create({"tool": {"name": "urdf"}, "material": stored}))
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    folder = tmp_path_factory.mktemp("material") / "run"
    words = [
        "task=BringCube",
        "material=pla",
        "material.infill=0.3",
        "film=false",
        "listener=[]",
    ]
    words += [
        "budget=tiny",
        "budget.n_tool=2",
        "budget.n_iteration=1",
        "executor.workers=1",
    ]
    return folder, run(load("config", words), folder)


@pytest.mark.thorough
def test_a_run_is_of_its_material(ran):
    folder, result = ran
    tool = result.best.candidate.tool
    filled = replace(PLA, infill=0.3)
    for component in tool.components:
        assert component.mass == pytest.approx(1240 * filled.volume_of(component.shape))
    assert json.loads((folder / "result.json").read_text())["material"] == "pla"
    masses = re.findall(
        r'mass value="(.*?)"', (folder / "best" / "tool.urdf").read_text()
    )
    assert sum(map(float, masses)) == pytest.approx(tool.mass)
    prompt = next((folder / "requests").glob("g0-*.md")).read_text()
    assert (
        "Tools are made of pla, 1240 kg/m^3, walls of 1.2 mm, filled to 30% inside"
        in prompt
    )
    assert "a mass that you write is ignored" in " ".join(prompt.split())
    assert "<mass" not in prompt


@pytest.mark.thorough
def test_a_stored_run_is_read_with_its_material(ran):
    folder, result = ran
    best = best_tool(read_run(folder))
    assert best.tool.mass == pytest.approx(result.best.candidate.tool.mass)
    assert best.material == replace(PLA, infill=0.3)
    assert configured([f"designs={folder}"]).material.infill == 0.3
    assert (
        configured([f"designs={folder}", "material=steel"]).material
        == load("evaluate", ["material=steel"]).material
    )
    assert configured([f"designs={folder}", "material.infill=1"]).material.infill == 1
