"""The program's own edits of an answer leave it sound, however it is written; and answers have the bounds of files."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from core.errors import UserError
from plugins.tasks.file.bench.edits import set_variation
from plugins.tasks.file.bench.scene_replies import read_reply
from plugins.tasks.file.pixels import read_pixels
from plugins.tasks.file.tree import Tree

FILE = Path("scene.yaml")
BLOCK = "  seen:  # benches\n    bodies.cube.mass: [1, 2, 3]\n"
SEEN = {"bodies.cube.mass": [1, 2, 3]}
OTHER = {"bodies.cube.mass": [1, 2]}
TEXT = "description: |\n  Of its\n  variations:\n    seen: none, and pictures: none.\n"


@pytest.mark.parametrize(
    ("written", "others"),
    [
        ("", {}),
        ("variations: {}\n", {}),
        ("variations: {}  # none\n", {}),
        ("variations:  # some\n  wide: {bodies.cube.mass: [1, 2]}\n", {"wide": OTHER}),
        ("variations:\n    wide:\n        bodies.cube.mass: [1, 2]\n", {"wide": OTHER}),
        ("variations: {wide: {bodies.cube.mass: [1, 2]}}\n", {"wide": OTHER}),
        (
            "variations: {seen: {a: [1, 2]},\n  wide: {bodies.cube.mass: [1, 2]}}\n",
            {"wide": OTHER},
        ),
        (
            "variations:\n  seen:\n    a: [1, 2]\n    b: [1, 2]\n  wide: {bodies.cube.mass: [1, 2]}\n",
            {"wide": OTHER},
        ),
        ("variations:\n  seen: {a: [1, 2]}\n", {}),
        ("variations:\n", {}),
    ],
)
@pytest.mark.parametrize("after", ["", "# The end.\ntable: true\n"])
def test_a_variation_is_written_into_any_file(written, others, after):
    text = f"{TEXT}{written}{after}"
    edited = set_variation(text, "seen", BLOCK)
    data = Tree(FILE, edited).data
    before = Tree(FILE, text).data
    assert data.pop("variations") == {"seen": SEEN, **others}
    before.pop("variations", None)
    assert data == before
    assert ("# The end." in edited) == bool(after)
    assert set_variation(edited, "seen", BLOCK) == edited


@pytest.mark.parametrize(
    ("reply", "said"),
    [
        ("name: a\n" + "#" * 100_000, "at most 100,000 are read"),
        ("```yaml\nname: a\n```\n" * 11, "the answer has 11 blocks; give one"),
    ],
)
def test_an_answer_has_the_bounds_of_a_file(reply, said):
    with pytest.raises(UserError, match=said):
        read_reply(FILE, reply)


def test_sixteen_bits_of_grey_are_not_white():
    grey = np.linspace(0, 65535, 64 * 48).reshape(48, 64).astype(np.uint16)
    stream = io.BytesIO()
    Image.fromarray(grey).save(stream, "PNG")
    _, _, png = read_pixels(stream.getvalue()).partition(b"\n")
    with Image.open(io.BytesIO(png)) as read:
        shown = np.asarray(read.convert("L"))

    assert shown[0, 0] < 5
    assert 120 < np.median(shown) < 136
    assert shown[-1, -1] > 250
