import pytest

from core.errors import UsageError, UserError
from core.plugins import installed
from plugins.new.new_command import main, write_scene


def test_the_command_writes_a_scene_and_says_how_to_go_on(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    main(["scene", "PushBlock"])
    assert capsys.readouterr().out == (
        "push_block.yaml: a scene, ready to be changed\n"
        "  vlmgineer render task=file task.file=push_block.yaml\n"
        "  vlmgineer conformance task=file task.file=push_block.yaml\n"
        "  python -m core.run task=file task.file=push_block.yaml\n"
    )
    assert (
        installed().create("task", "file", {"file": "push_block.yaml"}).name
        == "PushBlock"
    )


def test_nothing_is_overwritten(tmp_path):
    file = write_scene("Mine", tmp_path / "mine.yaml")
    file.write_text("my own")
    with pytest.raises(
        UserError, match=r"mine.yaml is there already; choose another name"
    ):
        write_scene("Mine", file)
    assert file.read_text() == "my own"


@pytest.mark.parametrize(
    ("name", "why"), [("my scene", "letters, digits"), ("BringCube", "is taken")]
)
def test_names_that_cannot_be_are_refused(tmp_path, name, why):
    with pytest.raises(UsageError, match=why):
        write_scene(name, tmp_path / "mine.yaml")
    assert not list(tmp_path.iterdir())


def test_a_folder_is_made_and_a_file_that_cannot_be_is_named(tmp_path):
    made = write_scene("Mine", tmp_path / "new" / "mine.yaml")
    with pytest.raises(UserError, match=r"can't write .*new/mine.yaml/mine.yaml: "):
        write_scene("Mine", made / "mine.yaml")
