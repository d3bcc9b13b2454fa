"""``vlmgineer import`` of things: a scene file in which they stand."""

import numpy as np
import pytest
import trimesh
import yaml

from core.config.compose import load
from core.errors import UsageError, UserError
from plugins.commands.import_file import ImportConfig
from plugins.tasks.file.import_scene import take_scene
from plugins.tasks.file.imports import mjcf, solids
from plugins.tasks.file.task import FileTask
from tests.plugins.tasks.file.imports.conftest import called
from tests.support.scene_files import TIN

# As robosuite has its objects: a body without shapes around one that has some, and no joint.
CASE = '<collision><origin xyz="0 0 {z}"/><geometry><box size="{size}"/></geometry></collision>'


def cabinet(more=""):
    """As PartNet-Mobility has them: no masses, no limits of effort, and a link with nothing in it."""
    return f"""<robot name="cabinet"><link name="base"/>
<link name="door">{CASE.format(size="0.02 0.36 0.3", z=0)}{more}</link>
<link name="case">{CASE.format(size="0.2 0.36 0.4", z=0)}</link><link name="lock"/>
<joint name="fixed" type="fixed"><parent link="base"/><child link="case"/></joint>
<joint name="hinge" type="revolute"><origin xyz="-0.15 -0.18 0"/><axis xyz="0 0 1"/><child link="door"/>
<parent link="case"/><limit lower="-1.57" upper="0"/></joint>
<joint name="key" type="continuous"><parent link="door"/><child link="lock"/><axis xyz="1 0 0"/></joint></robot>"""


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    for module in (mjcf, solids):
        monkeypatch.setattr(module, "isolated", called)


def take(file, *words):
    return take_scene(file, load("import", words, ImportConfig))


def test_an_object_without_a_joint_becomes_free_and_stands_on_the_table(tmp_path):
    (tmp_path / "tin.xml").write_text(TIN)
    taken = take(tmp_path / "tin.xml")
    task = FileTask(str(tmp_path / "tin.yaml"))
    (body,) = [body for body in task.scene(0).bodies if body.name == "object"]
    assert body.mass == pytest.approx(300 * np.pi * 0.03**2 * 0.1, rel=1e-3)
    np.testing.assert_allclose(body.pose.position, (0.6, 0.0, 0.0501), atol=1e-3)
    assert taken.words == ["task=file", f"task.file={tmp_path / 'tin.yaml'}"]
    assert list(taken.frames) == ["object"]
    assert any("fixed: false" in line for line in taken.lines)


def test_a_cabinet_gets_a_density_and_its_door_a_goal(tmp_path):
    (tmp_path / "cabinet.urdf").write_text(cabinet())
    taken = take(tmp_path / "cabinet.urdf", "density=400")
    task = FileTask(str(tmp_path / "cabinet.yaml"))
    door = next(body for body in task.scene(0).bodies if body.name == "door")
    assert door.mass == pytest.approx(400 * 0.02 * 0.36 * 0.3)
    assert any("density: 400" in line for line in taken.lines)
    assert any("nor a shape: lock" in line for line in taken.lines)
    (goal,) = task.goals
    assert goal.joint == "hinge"
    lowest = min(
        body.pose.position[2] for body in task.scene(0).bodies if body.name == "base"
    )
    assert lowest == pytest.approx(0.2001)


def test_a_mesh_in_millimetres(tmp_path):
    trimesh.creation.box((60, 40, 9000)).export(tmp_path / "tall.stl")
    with pytest.raises(UserError, match=r"9000|5 m"):
        take(tmp_path / "tall.stl")
    trimesh.creation.box((60, 40, 90)).export(tmp_path / "1 block.stl")
    taken = take(tmp_path / "1 block.stl")
    scene = yaml.safe_load((tmp_path / "1 block.yaml").read_text())
    assert scene["bodies"][0]["scale"] == 0.001
    assert any("millimetres" in line for line in taken.lines)
    (body,) = [
        body
        for body in FileTask(str(tmp_path / "1 block.yaml")).scene(0).bodies
        if body.name in taken.frames
    ]
    assert body.mass == pytest.approx(600 * 0.06 * 0.04 * 0.09, rel=1e-3)


def test_meshes_beside_the_files_folder_bring_the_scene_above_both(tmp_path):
    for name in ("urdf", "meshes"):
        (tmp_path / name).mkdir()
    trimesh.creation.box((0.02, 0.02, 0.02)).export(tmp_path / "meshes/knob.ply")
    mesh = '<collision><geometry><mesh filename="../meshes/knob.ply"/></geometry></collision>'
    file = tmp_path / "urdf/cabinet.urdf"
    file.write_text(cabinet(mesh))
    take(file)
    assert FileTask(str(tmp_path / "cabinet.yaml")).goals
    with pytest.raises(UsageError, match="is there already"):
        take(file)
    with pytest.raises(UsageError, match="a scene's files lie in its folder"):
        take(file, f"output={tmp_path}/meshes/other.yaml")


def test_a_mesh_that_is_missing_is_left_out_by_its_name(tmp_path):
    mesh = '<collision><geometry><mesh filename="knob.ply"/></geometry></collision>'
    (tmp_path / "cabinet.urdf").write_text(cabinet(mesh))
    with pytest.raises(UserError, match=r"without: \[knob.ply\]"):
        take(tmp_path / "cabinet.urdf")
    take(tmp_path / "cabinet.urdf", "without=[knob.ply]")
    assert FileTask(str(tmp_path / "cabinet.yaml")).goals


def test_a_body_that_nothing_joins_is_free_in_a_urdf(tmp_path):
    block = f'<robot name="block"><link name="a">{CASE.format(size="0.1 0.1 0.1", z=0)}</link></robot>'
    (tmp_path / "block.urdf").write_text(block)
    take(tmp_path / "block.urdf")
    scene = FileTask(str(tmp_path / "block.yaml")).scene(0)
    (body,) = [body for body in scene.bodies if body.name == "a"]
    assert body.mass == pytest.approx(0.6)
