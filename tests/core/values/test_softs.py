"""Requirements for soft bodies: their division into nodes and elements, limits, surfaces, and helpers of the state."""

import numpy as np
import pytest

from core.scene import (
    Body,
    Box,
    Cloth,
    Cylinder,
    Elastic,
    Filling,
    Joint,
    Pose,
    Rope,
    Scene,
    Soft,
    Sphere,
    State,
)

RED = (0.8, 0.2, 0.2, 1.0)
SPONGE = Elastic(300, 5e4)
ROPE = Rope(((0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.3, 0.1, 0.0)), 21, thickness=0.01)
FORMS = [
    ROPE,
    Cloth((0.3, 0.2), (7, 5)),
    Filling(Box((0.1, 0.2, 0.05)), (3, 4, 3)),
    Filling(Sphere(0.04), (4, 4, 4)),
]


def soft(form, elastic=SPONGE, at=(0.5, 0.0, 0.1), **given):
    return Soft.make(
        "it", form, elastic, Pose.xyz_rpy(at, (0.0, 0.0, 0.3)), color=RED, **given
    )


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.kind)
def test_elements_fill_the_form_and_weights_add_up(form):
    assert form.sizes.min() > 0
    assert form.weights.sum() == pytest.approx(1.0)
    assert set(np.unique(form.elements)) == set(range(len(form.nodes)))


def test_a_body_weighs_what_its_material_does():
    assert soft(FORMS[2]).mass == pytest.approx(300 * 0.1 * 0.2 * 0.05)
    assert soft(FORMS[1]).mass == pytest.approx(300 * 0.3 * 0.2 * 0.002)
    assert soft(ROPE).mass == pytest.approx(300 * 0.4 * np.pi * 0.005**2, rel=0.02)


@pytest.mark.parametrize(
    "shape", [Box((0.1, 0.2, 0.05)), Cylinder(0.04, 0.1), Sphere(0.04)]
)
def test_outer_nodes_lie_on_the_surface_of_the_shape(shape):
    mesh = soft(Filling(shape, (5, 5, 5))).visuals[0].shape.to_trimesh()
    assert mesh.is_volume
    assert np.allclose(mesh.bounds, shape.to_trimesh().bounds, atol=1e-3)
    assert mesh.volume > 0.85 * shape.to_trimesh().volume


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda: Elastic(300, 10.0), "young must be from 1000"),
        (lambda: Elastic(300, 1e4, poisson=0.5), "poisson must be from 0 to 0.45"),
        (lambda: Cloth((0.3, 0.3), (20, 20)), "at most 150 in all"),
        (lambda: Cloth((0.3, 0.0)), "two of its nodes are in one place"),
        (
            lambda: Rope(((0.0, 0.0, 0.0), (0.1, 0.0, 0.0)), thickness=0.001),
            "lighter, softer material",
        ),
        (
            lambda: soft(FORMS[2], Elastic(300, 1e6)),
            "Young's modulus of a solid can be 300000 Pa at most",
        ),
        (lambda: soft(ROPE, pinned=(21,)), "pinned nodes have numbers from 0 to 20"),
    ],
)
def test_what_no_engine_could_play_is_refused_in_a_line(wrong, says):
    with pytest.raises(ValueError, match=says) as caught:
        wrong()
    assert "\n" not in str(caught.value)


def test_no_joint_holds_a_soft_body():
    post = Body.of("post", Box((0.1, 0.1, 0.1)), (0, 0, 0), mass=0.0, color=RED)
    with pytest.raises(ValueError, match="a joint can't hold a soft body"):
        Scene((post, soft(ROPE)), (Joint("hinge", "hinge", "it", parent="post"),))


def test_the_state_has_nodes_and_measures_them_in_many_worlds():
    state = Scene((soft(FORMS[1], at=(0.5, 0.0, 0.1)),)).state()
    many = State.stack([state, state.each(lambda array: 2 * array)])
    assert many.nodes("it").shape == (2, 35, 3)
    assert np.allclose(many.position("it"), [[0.5, 0.0, 0.1], [1.0, 0.0, 0.2]])
    assert many.covered_area("it") == pytest.approx([0.06, 0.24], rel=1e-4)
    assert np.allclose(many.extent("it")[1], 2 * many.extent("it")[0])
    assert np.array_equal(many[1].nodes("it"), 2 * state.nodes("it"))
    with pytest.raises(KeyError, match="no soft body 'other'"):
        state.nodes("other")


def test_the_length_of_a_rope_goes_along_it():
    state = Scene((soft(ROPE),)).state()
    assert state.length("it") == pytest.approx(0.4, rel=0.01)
