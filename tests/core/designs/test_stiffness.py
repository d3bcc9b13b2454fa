"""How far tools bend, and what breaks them, with figures."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import DesignError, Fixture
from core.designs.rules import check_tool
from core.designs.stiffness import Beams
from core.geometry import Pose
from core.values.materials import Material
from tests.support.boxes import box, rigid
from tests.support.panda import PANDA

SOLID = Material("solid", 1240, young_pa=2.5e9, strength_pa=26e6)


def bar(length, thickness=0.005, mass=0.005):
    return rigid(
        box(at=(0, 0, -length / 2), size=(thickness, thickness, length), mass=mass)
    )


@pytest.mark.parametrize(("young_pa", "longest"), [(70e9, 0.47), (2.5e9, 0.157)])
def test_a_bar_bends_by_the_stiffness_of_its_material(young_pa, longest):
    """4 L^3 / (E t^4) per newton for a square bar."""
    made_of = replace(SOLID, young_pa=young_pa, strength_pa=None)
    check_tool(bar(longest), PANDA, made_of)
    with pytest.raises(
        DesignError,
        match=r"component 'a' is not rigid: of solid, 1 N would bend it by 1\d",
    ):
        check_tool(bar(1.06 * longest), PANDA, made_of)


def test_a_bar_breaks_by_the_strength_of_its_material():
    """6 F L / t^3 for a square bar: 54 mm."""
    check_tool(bar(0.053), PANDA, SOLID)
    with pytest.raises(DesignError) as error:
        check_tool(bar(0.06), PANDA, SOLID)
    assert str(error.value).startswith(
        "component 'a' would break: of solid, 10 N at its end mean a stress of 27.7 MPa"
    )
    assert "at most 26 MPa are allowed" in str(error.value)
    check_tool(bar(0.06), PANDA)


def test_what_is_hollow_bends_and_breaks_as_its_walls_do():
    """A section of 20 mm with walls of 2 mm, filled to a fifth."""
    joints = {"a": np.zeros(3)}
    materials = SOLID, replace(SOLID, infill=0.2, wall_mm=2.0)
    solid, hollow = (
        Beams(bar(0.2, 0.02), joints, made_of).bending()["a"] for made_of in materials
    )
    share = 1 - 0.8 * (16 / 20) ** 4
    assert hollow == pytest.approx(np.array(solid) / share)
    assert solid == pytest.approx(
        (4 * 0.2**3 / (2.5e9 * 0.02**4), 6 * 0.2 / 0.02**3), rel=0.02
    )


def test_a_joint_in_one_point_with_the_parents_is_no_beam():
    """The plate carries the bar, but nothing bends it."""
    plate = box("plate", (0, 0, 0), (0.05, 0.05, 0.001))
    rod = box("rod", (0, 0, -0.05), (0.02, 0.02, 0.1), parent="plate")
    joints = {"plate": np.zeros(3), "rod": np.zeros(3)}
    alone = Beams(
        rigid(replace(rod, parent="tool_mount")), {"rod": np.zeros(3)}, SOLID
    ).bending()["rod"]
    assert Beams(rigid(plate, rod), joints, SOLID).bending()["rod"] == pytest.approx(
        alone
    )


def fixture(length, thickness):
    """A bar along y that is held in its middle, beside a sound tool."""
    size = (thickness, length, thickness)
    parts = rigid(box(at=(0.02, 0, 0), size=size, mass=0.001))
    return replace(bar(0.05), fixture=Fixture(parts, Pose()))


def test_a_fixture_bends_and_breaks_as_a_tool_does():
    """Half of a bar of 0.3 m as a tool of 0.15 m; two wires of 0.5 mm carried 2 kg."""
    lasting = replace(SOLID, strength_pa=None)
    check_tool(fixture(0.3, 0.005), PANDA, lasting)
    with pytest.raises(
        DesignError, match="fixture: component 'a' is not rigid: of solid, 1 N would"
    ):
        check_tool(fixture(0.34, 0.005), PANDA, lasting)

    check_tool(fixture(0.1, 0.005), PANDA, SOLID)
    with pytest.raises(DesignError, match="fixture: component 'a' would break"):
        check_tool(fixture(0.12, 0.005), PANDA, SOLID)

    with pytest.raises(DesignError, match=r"fixture: .* is not rigid: even of steel"):
        check_tool(fixture(0.39, 0.0005), PANDA)
