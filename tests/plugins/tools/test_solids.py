import json
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from core.design import RIGID_MOUNT, Component, DesignError, Tool
from core.designs.rules import check_tool
from core.geometry import Box, Capsule, Compound, Cylinder, Mesh, Pose, Sphere
from plugins.tools.solids.making import MAX_PARTS
from plugins.tools.solids.representation import SolidTools
from plugins.tools.solids.tree_reading import MAX_NODES
from tests.support.panda import PANDA, on_panda
from tests.support.refusing import refused
from tests.support.shapes import SAMPLES, within

pytestmark = pytest.mark.slow

TOOLS = on_panda(SolidTools())

BALL = {"sphere": 0.03}
BOWL = {
    "difference": [
        {"sphere": 0.03},
        {"sphere": 0.027},
        {"box": [0.1, 0.1, 0.1], "at": [0, 0, 0.05]},
    ]
}
TUBE = {"difference": [{"cylinder": [0.03, 0.08]}, {"cylinder": [0.027, 0.1]}]}
L_PROFILE = {
    "extrude": [[0, 0], [0.08, 0], [0.08, 0.01], [0.01, 0.01], [0.01, 0.08], [0, 0.08]],
    "height": 0.05,
}
SLOTS = [{"box": [0.008, 0.08, 0.02], "at": [x, 0.02, 0]} for x in (-0.018, 0, 0.018)]
FORK = {"difference": [{"box": [0.06, 0.1, 0.01]}, *SLOTS]}
RING = [
    [0.03 + 0.005 * math.cos(t), 0.005 * math.sin(t)]
    for t in np.linspace(0, math.tau, 13)[:-1]
]
HOOK = {"revolve": RING, "angle": 4.7}
LADLE = {"union": [BOWL, {"cylinder": [0.005, 0.2], "at": [0.029, 0, 0.097]}]}
SPOOL = {
    "revolve": [
        [0, 0],
        [0.03, 0],
        [0.03, 0.005],
        [0.01, 0.01],
        [0.01, 0.03],
        [0.03, 0.035],
        [0, 0.04],
    ]
}
SHAPES = {
    "bowl": BOWL,
    "tube": TUBE,
    "L": L_PROFILE,
    "fork": FORK,
    "hook": HOOK,
    "ladle": LADLE,
    "spool": SPOOL,
}
STAR = np.linspace(0, math.tau, 25)[:-1]
COMB = [
    [0, 0],
    *(
        [0.02 * k + x, y]
        for k in range(11)
        for x, y in ((0, 0.2), (0.01, 0.2), (0.01, 0.01), (0.02, 0.01))
    ),
]
EXACT = {"L": 2, "fork": 7}  # and how many parts they need


def item(solid, name="a", **changes):
    return {
        "name": name,
        "solid": json.dumps(solid),
        "position": [0, 0, -0.05],
    } | changes


def parse(*items):
    return TOOLS.parse({"tool_solids": list(items)}, gripper=False)


def shape(solid):
    (component,) = parse(item(solid)).components
    return component.shape


def inside(meshes, points):
    """Tell which points are in one of convex meshes."""
    found = np.zeros(len(points), dtype=bool)
    for mesh in meshes:
        offsets = np.einsum("fx,fx->f", mesh.face_normals, mesh.triangles[:, 0])
        found |= (points @ mesh.face_normals.T <= offsets + 1e-9).all(axis=1)
    return found


@pytest.mark.parametrize(
    ("solid", "wanted"),
    [
        ({"box": [0.02, 0.03, 0.04]}, Box((0.02, 0.03, 0.04))),
        ({"sphere": 0.03}, Sphere(0.03)),
        ({"sphere": [0.03]}, Sphere(0.03)),
        ({"cylinder": [0.01, 0.2]}, Cylinder(0.01, 0.2)),
        ({"capsule": [0.01, 0.2]}, Capsule(0.01, 0.2)),
    ],
)
def test_a_primitive_stays_one_and_its_pose_moves_the_component(solid, wanted):
    (component,) = parse(
        item(solid | {"at": [0.1, 0, 0, 0, 0, 1.5]}, rpy=[0.2, 0, 0])
    ).components
    assert component.shape == wanted
    frame = Pose.xyz_rpy((0, 0, -0.05), (0.2, 0, 0)) @ Pose.xyz_rpy(
        (0.1, 0, 0), (0, 0, 1.5)
    )
    np.testing.assert_allclose(component.pose.matrix, frame.matrix, atol=1e-12)


@pytest.mark.parametrize("wanted", SAMPLES, ids=lambda sample: sample.kind)
def test_every_kind_of_shape_is_a_node_alone_and_in_others(wanted):
    tree = {wanted.kind: list(wanted.numbers)}
    assert shape(tree) == wanted
    rod = {"box": [0.1, 0.005, 0.005]}
    joined = shape({"union": [tree, rod]})
    assert wanted.volume < 1.03 * joined.volume < 1.05 * wanted.volume + 3e-6
    assert len(joined.convex_parts()) <= MAX_PARTS


@pytest.mark.parametrize(
    ("solid", "mm3"),
    [
        ({"cone": [0.01, 0, 0.03]}, math.pi * 1000),
        ({"cone": [0.01, 0.005, 0.03]}, math.pi * 1750),
        (
            {"extrude": [[0, 0], [0, 0.02], [0.01, 0]], "height": 0.03},
            3000,
        ),  # clockwise
        ({"revolve": [[0, 0], [0.02, 0], [0.02, 0.01], [0, 0.01]]}, math.pi * 4000),
        (
            {
                "revolve": [[0, 0], [0.02, 0], [0.02, 0.01], [0, 0.01]],
                "angle": math.pi / 2,
            },
            math.pi * 1000,
        ),
        ({"hull": [[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.03]]}, 500),
        (
            {"extrude": [[0, 0], [0.1, 0], [0, 0.1], [0, 0]], "height": 0.1},
            500000,
        ),  # closed twice
        (
            {
                "intersection": [
                    {"box": [0.02, 0.02, 0.02]},
                    {"box": [0.02, 0.02, 0.02], "at": [0.01, 0, 0]},
                ]
            },
            4000,
        ),
        (
            {
                "union": [
                    {"box": [0.02, 0.02, 0.02]},
                    {"box": [0.02, 0.02, 0.02], "at": [0.02, 0, 0]},
                ]
            },
            16000,
        ),
    ],
)
def test_what_is_convex_is_a_mesh(solid, mm3):
    made = shape(solid)
    assert isinstance(made, Mesh)
    assert made.volume * 1e9 == pytest.approx(mm3, rel=0.03)
    assert made.to_trimesh().is_watertight


@pytest.mark.parametrize("name", SHAPES)
def test_what_is_not_convex_has_convex_parts_within_1_mm(name):
    made = shape(SHAPES[name])
    assert isinstance(made, Compound)
    assert 2 <= len(made.parts) <= MAX_PARTS
    surface = made.surface.to_trimesh()
    parts = [part.to_trimesh() for part in made.parts]
    assert surface.is_watertight
    assert all(
        part.is_watertight and part.volume == pytest.approx(part.convex_hull.volume)
        for part in parts
    )
    # Its points are a tenth of a millimetre or two apart.
    near_solid = cKDTree(surface.sample(200_000, seed=0))
    out = np.vstack([part.sample(60, seed=1) for part in parts])
    out = out[~within(surface, out)]
    assert near_solid.query(out)[0].max(initial=0.0) < 0.0012
    near_parts = cKDTree(np.vstack([part.sample(20_000, seed=3) for part in parts]))
    missed = surface.sample(4000, seed=2)
    missed = missed[~inside(parts, missed)]
    assert near_parts.query(missed)[0].max(initial=0.0) < 0.0012
    if name in EXACT:
        assert len(parts) == EXACT[name]
        assert sum(part.volume for part in parts) == pytest.approx(
            surface.volume, rel=1e-6
        )


def test_a_bowl_is_open_and_a_tube_has_a_hole():
    for solid, free in (
        (BOWL, [0, 0, -0.02]),
        (TUBE, [0, 0, 0.03]),
        (HOOK, [0.0, 0.0, 0.0]),
    ):
        parts = [part.to_trimesh() for part in shape(solid).parts]
        assert not inside(parts, np.array([free])).any()


def test_equal_trees_make_equal_shapes_and_pickle():
    made = shape(TUBE)
    assert (
        pickle.loads(pickle.dumps(made)) == made == shape(json.loads(json.dumps(TUBE)))
    )
    tool = parse(item(TUBE))
    assert pickle.loads(pickle.dumps(tool)).content == tool.content


def test_the_rules_hold_and_a_values_tree_is_read_like_its_text():
    tool = parse(
        item(LADLE, position=[0, 0, -0.2], mass=0.02),
        {"name": "b", "solid": BALL, "position": [0, 0, -0.02]},
    )
    assert [type(c.shape) for c in tool.components] == [type(shape(LADLE)), Sphere]
    check_tool(
        parse(
            {"name": "b", "solid": {"cylinder": [0.02, 0.1]}, "position": [0, 0, -0.05]}
        ),
        PANDA,
    )


sizes = st.floats(0.005, 0.08)
steps = st.floats(-0.02, 0.02)
ats = st.tuples(steps, steps, steps, *[st.floats(-3.2, 3.2)] * 3).map(list)
leaves = st.one_of(
    st.builds(
        lambda x, y, z, at: {"box": [x, y, z], "at": at}, sizes, sizes, sizes, ats
    ),
    st.builds(lambda r, at: {"sphere": r, "at": at}, sizes, ats),
    st.builds(lambda r, h, at: {"cylinder": [r, h], "at": at}, sizes, sizes, ats),
    st.builds(lambda r, h, at: {"cone": [r, 0, h], "at": at}, sizes, sizes, ats),
    st.builds(lambda a, at: {**HOOK, "angle": a, "at": at}, st.floats(0.1, 6), ats),
    st.builds(lambda h, at: {**L_PROFILE, "height": h, "at": at}, sizes, ats),
)
trees = st.recursive(
    leaves,
    lambda inner: st.builds(
        lambda name, children: {name: children},
        st.sampled_from(["union", "difference", "intersection"]),
        st.lists(inner, min_size=2, max_size=3),
    ),
    max_leaves=4,
)


@settings(max_examples=40, deadline=None)
@given(trees, st.floats(0.001, 0.5))
def test_what_is_written_is_read_as_the_same_tool(tree, mass):
    try:
        tool = parse(item(tree, mass=mass))
    except DesignError:
        return
    written = TOOLS.dump(tool)
    back = TOOLS.parse(written, gripper=False)
    assert TOOLS.dump(back) == written
    (a,), (b,) = tool.components, back.components
    assert type(a.shape) is type(b.shape)
    np.testing.assert_allclose(a.shape.bounds[1], b.shape.bounds[1], atol=5e-5)
    assert len(a.shape.convex_parts()) <= MAX_PARTS


def test_shapes_that_were_not_made_here_are_written_by_their_parts():
    stretched = shape(FORK).resized((0.05, 0.1, 0.02))
    mesh = Mesh.from_trimesh(Box((0.1, 0.1, 0.1)).to_trimesh())
    tool = Tool(
        (
            Component("f", RIGID_MOUNT, Pose(), stretched),
            Component("m", "f", Pose(), mesh),
        )
    )
    written = TOOLS.dump(tool)
    back = TOOLS.parse(written, gripper=False)
    assert [len(c.shape.convex_parts()) for c in back.components] == [7, 1]
    assert [c.shape.volume for c in back.components] == pytest.approx(
        [c.shape.volume for c in tool.components], rel=1e-3
    )
    assert TOOLS.dump(back) == written


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("{'box': 1}", "E_SOLID_JSON"),
        ("\ud800", "E_SOLID_JSON"),
        ("x" * 20_001, "E_FIELD_LENGTH"),
    ],
)
def test_text_that_replies_mend_or_cut_is_refused(text, code):
    with refused(code):
        parse({"name": "a", "solid": text, "position": [0, 0, 0]})


def test_nodes_and_parts_are_counted_over_all_components():
    union = {"union": [{"box": [0.01, 0.01, 0.01]}] * (MAX_NODES // 2)}
    with refused("E_SOLID_NODES", where="component 'b'...", most=MAX_NODES):
        parse(item(union), item(union, "b"))
    left = {"most": MAX_PARTS, "left": ", of which ..."}
    with refused("E_SOLID_PARTS", where="component 'c'", **left):
        parse(*[item(BOWL, name) for name in "abc"])


def test_triangles_are_counted_over_all_components_but_not_those_of_whole_primitives():
    parse(*[item({"sphere": 0.5}, f"c{k}") for k in range(MAX_NODES)])
    lens = {"intersection": [{"sphere": 0.5}, {"sphere": 0.5, "at": [0.5, 0, 0]}]}
    parse(*[item(lens, name) for name in "abc"])
    with refused("E_SOLIDS_TRIANGLES", where="component 'd'", most=8000):
        parse(*[item(lens, name) for name in "abcd"])


@pytest.mark.parametrize(
    "last",
    [
        item({"blob": 1}, "z"),
        item(BALL, "z", parent="none"),
        item(BALL, "z", mass="much"),
        item(BALL),
    ],
)
def test_all_of_a_tool_is_read_before_a_solid_is_built(last, monkeypatch):
    monkeypatch.setattr(
        "plugins.tools.solids.representation.make_shape",
        lambda *_: pytest.fail("built"),
    )
    with pytest.raises(DesignError):
        parse(item(BOWL), last)


@pytest.mark.parametrize(
    "solid",
    [
        {
            "revolve": [
                [0.5 + r * math.cos(t), r * math.sin(t)]
                for t, r in zip(STAR, [0.4, 0.1] * 12, strict=True)
            ]
        },
        {
            "intersection": [
                {"extrude": COMB, "height": 0.5},
                {"extrude": COMB, "height": 0.5, "at": [0, 0, 0, 0, -math.pi / 2, 0]},
            ]
        },
    ],
)
def test_what_would_need_very_many_parts_is_refused(solid):
    with refused("E_SOLID_PARTS", where="component 'a'", within_mm=1, most=MAX_PARTS):
        shape(solid)


def test_many_holes_make_too_many_triangles():
    places = [(0.03 * (k % 6) - 0.1, 0.03 * (k // 6) - 0.1, k) for k in range(37)]
    holes = [
        {"cylinder": [0.01, 0.6], "at": [x, y, 0, k % 3 * 0.5, k % 2 * 0.7, 0]}
        for x, y, k in places
    ]
    with refused("E_SOLID_TRIANGLES", where="component 'a'", most=8000):
        shape({"difference": [{"box": [0.5, 0.5, 0.5]}, *holes]})


def test_parts_that_no_tolerance_keeps_near_the_solid_are_refused(monkeypatch):
    monkeypatch.setattr("plugins.tools.solids.making.deviation", lambda *_: 5.0)
    tube = {"difference": [{"cylinder": [0.031, 0.08]}, {"cylinder": [0.027, 0.1]}]}
    with refused("E_SOLID_CONVEX", within_mm=1, off_mm=5):
        shape(tube)  # a new one: what was made is kept


@pytest.mark.parametrize("axis", [[-0.00566, -0.00933, 0.01587], [0, 0, 1], [1, -1, 0]])
def test_a_joint_is_written_as_it_is_read(axis):
    tools = on_panda(SolidTools(joints=True))
    joint = {
        "kind": "hinge",
        "axis": axis,
        "at": [0.00310324, 0.0169375, -0.0118702],
        "lower": -0.2,
        "upper": 0.3,
    }
    tool = tools.parse(
        {"tool_solids": [item(BALL, rpy=[0, 2.36756533, 0], joint=joint)]},
        gripper=False,
    )
    written = tools.dump(tool)
    assert tools.dump(tools.parse(written, gripper=False)) == written
    back = np.array(written["tool_solids"][0]["joint"]["axis"])
    np.testing.assert_allclose(
        back / np.linalg.norm(back), axis / np.linalg.norm(axis), atol=1e-5
    )
