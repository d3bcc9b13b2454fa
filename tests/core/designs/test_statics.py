"""The rules for the weight of tools of a real material, with figures."""

import re
from dataclasses import replace

import numpy as np
import pytest

from core.config.compose import load
from core.design import Component, DesignError, Tool
from core.designs.composer import as_markdown
from core.designs.rules import check_tool
from core.designs.statics import check_weight, flange_moment, moment_limit
from core.geometry import Box, Pose
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.values.materials import PAPER, Material
from core.values.printers import MK4
from plugins.commands.prompt import PromptConfig, compose
from plugins.tools.mounting import describe_weight
from tests.support.boxes import box, rigid
from tests.support.panda import PANDA
from tests.support.rare import rare

SOLID = Material("solid", 1240, young_pa=2.5e9, strength_pa=26e6)


def test_the_wrist_of_every_arm_has_a_limit():
    assert moment_limit(PANDA) == 12.0
    for name in installed().names("robot"):
        if name != "urdf":
            robot = installed().create("robot", name)
            assert 0 < moment_limit(robot) == arm_of(robot).effort_limits[-3:].min()


def test_the_moment_is_that_of_the_centre_of_mass_in_the_worst_orientation():
    tool = rigid(
        box(at=(0, 0, -0.1), mass=1.0), box("b", (0.6, 0, 0), mass=1.0, parent="a")
    )
    assert flange_moment(tool, PANDA) == pytest.approx(2 * 9.81 * np.hypot(0.3, 0.1))
    assert flange_moment(
        rigid(box(at=(-0.3, 0, 0)), box("b", (0.6, 0, 0), parent="a")), PANDA
    ) == pytest.approx(0)


def test_attachments_to_the_fingers_are_weighed_where_the_open_fingers_are():
    shape = Box((0.02, 0.02, 0.02))
    pads = (
        Component(f"{side}_pad", f"{side}_finger", Pose(), shape, 0.5)
        for side in ("left", "right")
    )
    moment = flange_moment(Tool(tuple(pads), gripper=True), PANDA)
    # The fingers' frames lie 58.4 mm below the mount.
    assert moment == pytest.approx(9.81 * 0.0584, rel=1e-3)


def test_what_is_too_heavy_is_refused_with_the_figures():
    check_weight(rigid(box(mass=1.0), box("b", mass=1.9, parent="a")), PANDA, SOLID)
    with pytest.raises(DesignError) as error:
        check_weight(rigid(box(mass=1.0), box("b", mass=2.1, parent="a")), PANDA, SOLID)
    assert str(error.value) == (
        "the tool weighs 3.1 kg; the arm carries at most 3 kg; component 'b' weighs most, 2.1 kg: make parts thinner, "
        "shorter or fewer"
    )


@pytest.mark.parametrize("material", rare([PAPER, SOLID], SOLID))
def test_a_budget_of_material_is_a_limit_too_and_the_prompt_names_it(material):
    tool = rigid(box(at=(0, 0, -0.05), size=(0.05, 0.05, 0.1), mass=0.31))
    check_tool(tool, PANDA, replace(material, most_g=310))
    with pytest.raises(
        DesignError, match=r"the tool weighs 0.31 kg; the budget of material is 0.3 kg"
    ):
        check_tool(tool, PANDA, replace(material, most_g=300))
    words = [
        f"material={'paper' if material is PAPER else 'pla'}",
        "material.most_g=300",
    ]
    for name in ("urdf", "boxes", "solids"):
        prompt = compose(
            load(
                "prompt", [f"tool={name}", "prompt.picture=false", *words], PromptConfig
            )
        ).messages[-1]
        assert re.search(r"0\.3\s+kg(,| for the tool)", as_markdown(prompt))


def test_what_turns_the_wrist_is_refused_with_the_figures():
    check_weight(rigid(box(at=(0.61, 0, 0), mass=2.0)), PANDA, SOLID)
    with pytest.raises(DesignError) as error:
        check_weight(rigid(box(at=(0.7, 0, 0), mass=2.0)), PANDA, SOLID)
    assert str(error.value) == (
        "the tool, of 2 kg, turns the wrist with 13.7 N m, its centre of mass being 0.7 m from the mount; at most "
        "12 N m are allowed; component 'a' weighs most, 2 kg: make parts thinner, shorter or fewer, or bring heavy "
        "parts closer to the mount"
    )


def test_paper_knows_no_moment_and_a_material_no_limits_of_mass_and_density():
    arm = box(at=(0.5, 0, -0.005), size=(1.0, 0.02, 0.02))
    load = box("b", (0.5, 0, 0), (0.1, 0.1, 0.1), mass=0.9, parent="a")
    far = rigid(arm, load, replace(load, name="c"), replace(load, name="d"))
    check_tool(far, PANDA)
    with pytest.raises(DesignError, match=r"turns the wrist with 26.5 N m"):
        check_tool(far, PANDA, SOLID)
    heavy = rigid(box(at=(0, 0, -0.05), size=(0.1, 0.1, 0.1), mass=1.24))
    check_tool(heavy, PANDA, SOLID)
    with pytest.raises(DesignError, match=r"weighs 1.24 kg; it must be between"):
        check_tool(heavy, PANDA)


def test_the_prompt_says_what_tools_weigh_and_may():
    text = " ".join(
        describe_weight(replace(SOLID, infill=0.2, wall_mm=1.2), PANDA, MK4).split()
    )
    assert "solid, 1240 kg/m^3, walls of 1.2 mm, filled to 20% inside" in text
    assert "The tool may weigh 3 kg, and turn the wrist with 12 N m" in text
    assert "printed on a plate of 250 x 210 x 220 mm" in text
    assert "thinner than 0.8 mm" in text
    metal = describe_weight(replace(SOLID, density_kg_m3=2700.0), PANDA, MK4)
    assert "plate" not in metal
