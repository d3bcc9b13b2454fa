"""A scene file with a mistake gives one line that says where it is; any other text does no harm."""

import os
import random

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import UserError
from core.values.layouts import NONE
from plugins.tasks.file import building
from plugins.tasks.file.building import build_scene
from plugins.tasks.file.task import FileTask
from plugins.tasks.file.tree import MAX_BYTES
from tests.support.refusing import refused
from tests.support.scene_files import OPEN_DOOR
from tests.support.text import replaced_all


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path / "my_scene.yaml"


def line_of(file, text):
    """The one line about a file of this text."""
    file.write_text(text, encoding="utf-8")
    with pytest.raises(UserError) as caught:
        FileTask(file.name)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert line.startswith("my_scene.yaml")
    return line.removeprefix("my_scene.yaml").removeprefix(", ")


def test_the_file_without_mistakes_is_read(file):
    file.write_text(OPEN_DOOR)
    assert FileTask(file.name).name == "OpenDoor"


@pytest.mark.parametrize("text", ["", "- a\n- b\n"])
def test_what_is_no_object_is_refused(file, text):
    file.write_text(text)
    with refused("E_YAML_OBJECT", file="my_scene.yaml"):
        FileTask(file.name)


def test_a_second_document_is_refused(file):
    file.write_text(f"{OPEN_DOOR}---\nname: Second\n")
    where = {"file": "my_scene.yaml, line 41"}
    with refused("E_NO_YAML", problem="but found another document", **where):
        FileTask(file.name)


def test_a_file_that_is_not_there_or_no_text_is_named(file):
    with pytest.raises(
        UserError, match=r"scene file my_scene.yaml: there is no such file"
    ):
        FileTask(file.name)
    file.write_bytes(b"x" * (MAX_BYTES + 1))
    with pytest.raises(
        UserError, match=r"my_scene.yaml has 0.1 MB; at most 0.1 MB are read"
    ):
        FileTask(file.name)
    file.write_bytes(b"name: \xff")
    with pytest.raises(UserError, match=r"my_scene.yaml is not UTF-8 text \(byte 6\)"):
        FileTask(file.name)


def test_a_pipe_or_an_odd_name_is_refused_at_once(file):
    os.mkfifo(file)
    with pytest.raises(UserError, match=r"my_scene.yaml is no regular file"):
        FileTask(file.name)
    with pytest.raises(
        UserError, match=r"'my\\x00scene' can't be a file's name: .*embedded null"
    ):
        FileTask("my\0scene")
    (file.parent / "pipe.stl").symlink_to(file)
    file.with_name("scene.yaml").write_text(
        replaced_all(OPEN_DOOR, ("sphere: {radius: 0.04}", "file: pipe.stl"))
    )
    with pytest.raises(
        UserError, match=r"bodies.2.: mesh .*my_scene.yaml is no regular file"
    ):
        FileTask("scene.yaml")


def test_variations_are_few_and_built_twice_each(file, monkeypatch):
    """A file of 100 kB had room for 3,150 ranges, each of which built the scene twice."""
    ranges = [
        f"  v{n}: {{bodies.ball.position.x: [0, 1], bodies.ball.mass: [1, 2]}}\n"
        for n in range(20)
    ]
    assert "at most 20 items" in line_of(
        file, replaced_all(OPEN_DOOR, ("  near:", f"{''.join(ranges)}  near:"))
    )
    built = []
    monkeypatch.setattr(
        building, "build_scene", lambda *given: built.append(1) or build_scene(*given)
    )
    file.write_text(
        replaced_all(OPEN_DOOR, ("  near:", f"{''.join(ranges[:19])}  near:"))
    )
    assert len(FileTask(file.name).variations) == 20
    assert len(built) == 1 + 2 * 20


def test_a_link_that_leads_out_of_the_folder_is_not_followed(file, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside") / "ball.stl"
    outside.write_bytes(b"solid")
    (file.parent / "ball.stl").symlink_to(outside)
    text = replaced_all(OPEN_DOOR, ("sphere: {radius: 0.04}", "file: ball.stl"))
    assert "ball.stl is not in folder" in line_of(file, text)


@pytest.fixture(scope="module")
def wild(tmp_path_factory):
    return tmp_path_factory.mktemp("wild") / "wild.yaml"


def places(node, at=()):
    """The ways to all entries of a tree."""
    yield at
    for key, inner in (
        node.items()
        if isinstance(node, dict)
        else enumerate(node)
        if isinstance(node, list)
        else ()
    ):
        yield from places(inner, (*at, key))


def changed(node, at, value):
    if not at:
        return value
    copy = dict(node) if isinstance(node, dict) else list(node)
    copy[at[0]] = changed(node[at[0]], at[1:], value)
    return copy


WORDS = (
    "ball",
    "door",
    "post",
    "hinge",
    "name",
    "mass",
    "box",
    "file",
    "at",
    "bodies.ball.mass",
    "..",
    "1e3",
    "none",
)
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(WORDS)
)
TREES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text(max_size=5) | st.sampled_from(WORDS), inner)
    ),
    max_leaves=10,
)
ROPE = {
    "name": "rope",
    "rope": {"path": [[0, 0, 0], [0, 0, 1]], "count": 9},
    "elastic": {"density": 300, "young": 1e4},
}
OPEN_DOOR_TREE = yaml.safe_load(OPEN_DOOR)
OPEN_DOOR_TREE["bodies"].append({**ROPE, "pinned": [0]})
PLACES = list(places(OPEN_DOOR_TREE))


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from(PLACES), TREES), min_size=1, max_size=3),
    st.booleans(),
)
def test_wild_trees_are_read_or_refused(wild, edits, flow):
    tree = OPEN_DOOR_TREE
    for at, value in edits:
        try:
            tree = changed(tree, at, value)
        except (LookupError, TypeError):  # an edit before took the place away
            continue
    wild.write_text(
        yaml.safe_dump(tree, default_flow_style=flow, allow_unicode=False),
        encoding="utf-8",
    )
    read_or_refused(wild)


@settings(max_examples=100, deadline=None)
@given(
    st.binary(max_size=200) | st.text(max_size=200).map(str.encode),
    st.integers(0, 2**32),
)
def test_wild_bytes_are_read_or_refused(wild, noise, seed):
    at = sorted(random.Random(seed).choices(range(len(OPEN_DOOR)), k=2))
    rng = OPEN_DOOR.encode()
    wild.write_bytes(rng[: at[0]] + noise + rng[at[1] :])
    read_or_refused(wild)


def read_or_refused(file):
    problem = ""
    task = None
    try:
        task = FileTask(str(file))
    except UserError as error:
        problem = str(error)
    assert len(problem.splitlines()) <= 1
    for variation in (NONE, *task.variations) if task is not None else ():
        FileTask(str(file), variation).scene(1)
