"""``vlmgineer import``: one door for arms, grippers and things."""

import numpy as np
import pytest
from PIL import Image as Pillow

from core.errors import UsageError, UserError
from core.geometry import Pose
from core.scene import Camera
from plugins.commands import import_file
from tests.support.hands import hand
from tests.support.scene_files import TIN

DOWN = Camera((0.6, 0.0, 1.0), (0.6, 0.0, 0.0), 60.0)


def test_axes_are_drawn_where_the_frames_are():
    blank = np.full((200, 200, 3), 255, dtype=np.uint8)
    pose = Pose.xyz_rpy((0.6, 0.0, 0.0))
    picture = import_file.draw_axes(blank, DOWN, {"": pose})
    red = (picture == import_file._COLORS[0]).all(axis=2)
    green = (picture == import_file._COLORS[1]).all(axis=2)
    # From above x is to the right, and y up.
    rows, columns = np.nonzero(red)
    assert columns.max() > 110
    assert np.abs(rows - 100).max() <= 2
    rows, columns = np.nonzero(green)
    assert rows.min() < 90
    assert np.abs(columns - 100).max() <= 2


@pytest.mark.thorough
def test_an_object_gets_a_scene_and_a_picture(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tin.xml").write_text(TIN)
    import_file.main(["tin.xml"])
    said = capsys.readouterr().out
    assert (
        f"type next: python -m core.run task=file task.file={tmp_path}/tin.yaml" in said
    )
    assert Pillow.open(tmp_path / "tin.png").size == (960, 720)


def test_a_gripper_is_told_how_to_become_a_part_of_an_arm(tmp_path, capsys):
    (tmp_path / "hand.urdf").write_text(hand())
    import_file.main([str(tmp_path / "hand.urdf")])
    said = capsys.readouterr().out
    assert '<parent link="FLANGE"/><child link="palm"/>' in said
    assert "robot.gripper={link:palm,joints:[slide_a,slide_b]}" in said


def test_mistakes_of_words(tmp_path):
    (tmp_path / "tin.xml").write_text(TIN)
    file = str(tmp_path / "tin.xml")
    with pytest.raises(UsageError, match="usage: vlmgineer import FILE"):
        import_file.main([])
    with pytest.raises(UsageError, match="no kind 'boat'"):
        import_file.main([file, "kind=boat"])
    with pytest.raises(UserError, match="no joint moves in this MJCF file"):
        import_file.main([file, "kind=arm"])
    with pytest.raises(UserError, match="can't be read"):
        import_file.main([str(tmp_path / "none.urdf")])
