import numpy as np
import pinocchio
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import UserError
from core.scene import Scene
from plugins.tasks.file.imports import read_bodies
from tests.support.cabinets import BOX, cabinet, joint, link, mesh
from tests.support.text import replaced_all


def read(folder, text, **options):
    file = folder / "model.urdf"
    file.write_text(f'<robot name="model">{text}</robot>')
    return read_bodies(file, **options)


def test_links_that_are_rigidly_joined_are_one_body_on_its_joint(tmp_path):
    dynamics = '<dynamics damping="3" friction="0.5"/>'
    made = read(tmp_path, cabinet(more=dynamics), prefix="a_")
    case, drawer = made.bodies
    assert (case.name, case.fixed, drawer.name, drawer.friction) == (
        "a_case",
        True,
        "a_drawer",
        0.5,
    )
    assert drawer.mass == 2.5
    assert len(drawer.collisions) == 2
    np.testing.assert_allclose(
        (drawer.pose @ drawer.collisions[1].pose).position, [0, 0.2, 0.5], atol=1e-9
    )
    (rail,) = made.joints
    assert (rail.name, rail.kind, rail.body, rail.parent) == (
        "a_rail",
        "slider",
        "a_drawer",
        "a_case",
    )
    assert (rail.lower, rail.upper, rail.damping, rail.friction) == (0, 0.3, 3, 0.5)


def test_without_a_fixed_root_all_can_move(tmp_path):
    made = read(tmp_path, cabinet(), fixed=False)
    assert [body.mass for body in made.bodies] == [2, 2.5]


def test_a_root_without_shapes_is_the_world(tmp_path):
    made = read(
        tmp_path,
        '<link name="world"/>'
        + link("door")
        + joint("hinge", "continuous", "world", "door"),
    )
    assert [body.name for body in made.bodies] == ["door"]
    assert (made.joints[0].parent, made.joints[0].limited) == (None, False)


def test_a_joint_starts_in_its_range(tmp_path):
    made = read(tmp_path, cabinet('<limit lower="0.1" upper="0.3"/>'))
    assert made.joints[0].start == 0.1
    np.testing.assert_allclose(made.bodies[1].pose.position, [0, 0.1, 0.5], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "note"),
    [
        (cabinet(kind="planar"), "planar"),
        (cabinet('<limit lower="0" upper="0"/>'), "no range"),
        (cabinet('<limit lower="-4" upper="4"/>', "revolute"), "whole turn"),
        (cabinet(more='<mimic joint="glue"/>'), "mimics"),
        (cabinet() + "<gazebo/><transmission/>", "left out: 1 <gazebo>"),
    ],
)
def test_what_is_left_out_or_changed_is_said(tmp_path, text, note):
    made = read(tmp_path, text)
    assert any(note in line for line in made.notes), made.notes
    Scene(made.bodies, made.joints)


def test_meshes_of_its_folder_are_read(tmp_path):
    (tmp_path / "model").mkdir()
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "model" / "box.obj")
    inside = (
        mesh("package://model/box.obj")
        + mesh("model/box.obj", "visual")
        + mesh("model/box.dae", "visual")
    )
    (tmp_path / "model" / "box.dae").write_text("")
    made = read(tmp_path, link("crate", inside), fixed=False)
    (body,) = made.bodies
    assert body.collisions[0].shape.volume == pytest.approx(0.008)
    assert len(body.visuals) == 1
    assert any("box.dae" in note for note in made.notes)


def test_meshes_are_found_as_those_of_arms_are(tmp_path):
    """Nearly where the file says; what is only drawn may be missing."""
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.stl")
    inside = mesh("shapes/Box.STL") + mesh("gone.obj", "visual")
    made = read(tmp_path, link("crate", inside))
    assert len(made.bodies[0].collisions) == 1
    notes = "\n".join(made.notes)
    assert "1 meshes are not where the file says" in notes
    assert "not drawn: link 'crate': visual: there is no mesh file" in notes


def test_a_mesh_of_a_very_long_path_is_soon_missed(tmp_path):
    with pytest.raises(UserError, match="no mesh file"):
        read(tmp_path, link("a", mesh("a/" * 100_000 + "box.stl")))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<", "malformed"),
        (link("a&#10;b"), "its name is not of letters"),
        (
            link("a") + link("b", mass=1e5) + joint("j", "floating", "a", "b"),
            "'b' has 1e.05 kg",
        ),
        (link("a", replaced_all(BOX, ("0.2", "100000"))), "'a' .* 20 m"),
        (
            link("a", replaced_all(BOX, ("0.2", "5e-324"))),
            "'a' has a collision shape of 4.94e-324 m; at least 1e-06 m",
        ),
        (cabinet('<limit lower="0" upper="900000"/>'), "its range"),
        (link("a", mesh("/etc/passwd")), "no kind"),
        (link("a", mesh("../outside.stl")), "is not in folder"),
        (link("a", mesh("http://x.org/a.stl")), "http:// is not read"),
        (link("a", mesh("missing.stl")), "no mesh file"),
        (
            link("a", mesh("missing&#10;line.stl")),
            r"no mesh file .*missing\\nline.stl \(named",
        ),
        (
            link("a") + link("b", "") + joint("j", "floating", "a", "b"),
            "no collision shape",
        ),
        (link("a") + link("b", mass=0) + joint("j", "floating", "a", "b"), "no mass"),
        (cabinet('<limit lower="1" upper="0"/>'), "exchange them"),
        (cabinet(more='<dynamics damping="-1"/>'), "damping must be"),
        (link("a") + link("b"), "2 links have no parent"),
    ],
)
def test_what_cannot_be_read_is_one_clear_line(tmp_path, text, message):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "outside.stl")
    folder = tmp_path / "inside"
    folder.mkdir()
    with pytest.raises(UserError, match=message) as error:
        read(folder, text)
    assert "\n" not in str(error.value)
    assert "model.urdf" in str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("thing.sdf", "<sdf><model name='a'/></sdf>", "is SDF, .*sdf2mjcf .*thing.sdf"),
        ("thing.usda", "#usda 1.0", "is USD, .*usd_to_urdf"),
        ("thing.xml", "<html/>", "is a web page"),
    ],
)
def test_a_file_of_another_kind_names_its_converter(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=message):
        read_bodies(tmp_path / name)


def test_a_urdf_is_one_whatever_its_name(tmp_path):
    (tmp_path / "model.xml").write_text(f"<robot name='a'>{link('a')}</robot>")
    assert [body.name for body in read_bodies(tmp_path / "model.xml").bodies] == ["a"]


NUMBERS = st.tuples(*[st.floats(-2, 2).map(lambda value: round(value, 3))] * 3)


@st.composite
def trees(draw):
    text = link("link0")
    kinds = ["revolute", "continuous", "prismatic", "fixed"]
    for number in range(1, draw(st.integers(2, 6))):
        axis = draw(NUMBERS.filter(lambda v: np.linalg.norm(v) > 0.2))
        origin = f'<origin xyz="{_words(draw(NUMBERS))}" rpy="{_words(draw(NUMBERS))}"/><axis xyz="{_words(axis)}"/>'
        above = f"link{draw(st.integers(0, number - 1))}"
        limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
        kind = draw(st.sampled_from(kinds))
        text += link(f"link{number}") + joint(
            f"joint{number}", kind, above, f"link{number}", origin + limit
        )
    return text


def _words(values):
    return " ".join(map(str, values))


@given(text=trees())
@settings(max_examples=60, deadline=None)
def test_links_and_axes_are_where_pinocchio_has_them(tmp_path_factory, text):
    made = read(tmp_path_factory.mktemp("tree"), text)
    model = pinocchio.buildModelFromXML(f'<robot name="model">{text}</robot>')
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    pinocchio.computeJointJacobians(model, data, pinocchio.neutral(model))
    bodies = {body.name: body for body in made.bodies}
    for name, body in bodies.items():
        frame = data.oMf[model.getFrameId(name)]
        np.testing.assert_allclose(body.pose.position, frame.translation, atol=1e-9)
        np.testing.assert_allclose(
            body.pose.rotation.as_matrix(), frame.rotation, atol=1e-9
        )
    assert {joint.name for joint in made.joints} == set(model.names) - {"universe"}
    for made_joint in made.joints:
        number = model.getJointId(made_joint.name)
        moved = pinocchio.getJointJacobian(
            model, data, number, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        moved = moved.reshape(6, -1)[:, model.joints[number].idx_v]
        axis = bodies[made_joint.body].pose.rotation.apply(made_joint.axis)
        np.testing.assert_allclose(
            moved[:3] if made_joint.kind == "slider" else moved[3:], axis, atol=1e-9
        )


def test_links_are_left_out_with_all_that_hangs_from_them(tmp_path):
    (case,) = read(tmp_path, cabinet(), without=("dr*",)).bodies
    assert case.name == "case"
    assert not read(tmp_path, cabinet(), without=("drawer",)).joints

    case, drawer = read(tmp_path, cabinet(), prefix="a_", without=("a_handle",)).bodies
    assert (drawer.name, drawer.mass) == ("a_drawer", 2.0)


def test_what_can_not_be_left_out_is_said(tmp_path):
    with pytest.raises(UserError, match="no body to leave out 'arm'; possible: case"):
        read(tmp_path, cabinet(), without=("arm",))
    with pytest.raises(UserError, match="without case nothing is left"):
        read(tmp_path, cabinet(), without=("case",))


WEIGHTLESS = f'<link name="case">{BOX}</link><link name="door">{BOX}</link>' + joint(
    "hinge", "revolute", "case", "door", '<limit lower="-1" upper="0"/>'
)


def test_what_moves_without_a_mass_gets_it_by_its_density(tmp_path):
    with pytest.raises(UserError, match="density: 600"):
        read(tmp_path, WEIGHTLESS)
    made = read(tmp_path, WEIGHTLESS, density=600.0)
    masses = {body.name: body.mass for body in made.bodies}
    assert masses == {"case": 0, "door": pytest.approx(600 * 0.1 * 0.2 * 0.3)}

    heavy = replaced_all(
        WEIGHTLESS,
        (
            '<link name="door">',
            '<link name="door"><inertial><mass value="3"/></inertial>',
        ),
    )
    again = read(tmp_path, heavy, density=600.0)
    assert {body.name: body.mass for body in again.bodies}["door"] == 3


def test_a_mesh_that_is_missing_is_left_out_by_its_name(tmp_path):
    shape = (
        '<collision><geometry><mesh filename="parts/gone.obj"/></geometry></collision>'
    )
    text = link("case", BOX + shape)
    with pytest.raises(UserError, match=r"without: \[parts/gone\.obj\]"):
        read(tmp_path, text)
    made = read(tmp_path, text, without=["parts/gone.obj"])
    (case,) = made.bodies
    assert len(case.collisions) == 1
    assert any("parts/gone.obj" in note for note in made.notes)
    with pytest.raises(UserError, match="body to leave out"):
        read(tmp_path, text, without=["parts/other.obj"])
