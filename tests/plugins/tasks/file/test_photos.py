"""Photographs of one's own bench, from a scene file to the request."""

import io

import pytest
from PIL import Image, PngImagePlugin

from core.config.compose import load
from core.errors import UserError
from core.values.messages import Picture
from plugins.commands.prompt import PromptConfig, compose
from plugins.tasks.file import photos
from plugins.tasks.file.task import FileTask
from tests.plugins.tasks.file.imports.conftest import called
from tests.support.scene_files import OPEN_DOOR

PHOTO = "pictures: [a.jpg, {file: b.png, camera: {position: [1.4, -0.9, 0.8], target: [0.6, 0, 0.1], fov_deg: 42}}]\n"


def scene(folder, pictures):
    (folder / "scene.yaml").write_text(OPEN_DOOR + pictures)
    return str(folder / "scene.yaml")


@pytest.fixture
def bench(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned by 90 degrees
    exif[0x010E] = "the bench of Mary"  # a description
    written = {
        "exif": exif,
        "icc_profile": b"the display of Mary",
        "comment": b"Mary was here",
        "dpi": (72, 72),
    }
    Image.new("RGB", (2000, 1000), (200, 30, 30)).save(tmp_path / "a.jpg", **written)
    texts = PngImagePlugin.PngInfo()
    texts.add_text("Author", "Mary", zip=True)
    texts.add_itxt("XML:com.adobe.xmp", "<x>Mary</x>")
    written |= {"exif": b"", "pnginfo": texts}
    Image.new("RGBA", (640, 480), (0, 200, 0, 255)).save(tmp_path / "b.png", **written)
    return tmp_path


@pytest.mark.thorough
@pytest.mark.slow
def test_they_are_sent_beside_the_drawn_picture_or_alone(bench):
    file = scene(bench, PHOTO)

    def sent(*words):
        cfg = load(
            "prompt",
            ["task=file", f"task.file={file}", "vlm=replay", "sim=mujoco", *words],
            PromptConfig,
        )
        return [
            part
            for message in compose(cfg).messages
            for part in message.parts
            if isinstance(part, Picture)
        ]

    assert [picture.name for picture in sent()] == ["scene", "photo1", "photo2"]
    assert [picture.name for picture in sent("prompt.photographs=none")] == ["scene"]
    alone = sent("prompt.photographs=alone")
    assert [picture.name for picture in alone] == ["photo1", "photo2"]
    pixels = [Image.open(io.BytesIO(picture.png)) for picture in alone]
    assert [read.size for read in pixels] == [(640, 1280), (640, 480)]
    # Pillow reads what else a PNG file holds into these.
    assert [(read.format, read.text, read.info) for read in pixels] == 2 * [
        ("PNG", {}, {})
    ]
    assert "not known" in alone[0].caption
    assert "camera at (1.400, -0.900, 0.800)" in alone[1].caption
    assert "640 x 480 pixels, focal length 625.2 pixels" in alone[1].caption


@pytest.mark.parametrize(
    ("pictures", "said"),
    [
        ("pictures: [none.jpg]", "photograph .*none.jpg can't be read: No such file"),
        ("pictures: [scene.yaml]", "scene.yaml is no PNG or JPEG"),
        ("pictures: [../out.png]", "out.png is not in folder .*; put it there"),
        ("pictures: [large.png]", "has 9000 x 9000 pixels; at most 64,000,000"),
        (
            "pictures: [{file: b.png, camera: {height_m: 1}}]",
            "in perspective; give fov_deg",
        ),
        ("pictures: [half.jpg]", "half.jpg is no PNG or JPEG picture that can be read"),
    ],
)
def test_what_is_no_photograph_is_refused_in_a_line(bench, pictures, said, monkeypatch):
    monkeypatch.setattr(photos, "isolated", called)
    Image.new("1", (9000, 9000)).save(bench / "large.png")
    (bench / "half.jpg").write_bytes((bench / "a.jpg").read_bytes()[:3000])
    with pytest.raises(UserError, match=said) as caught:
        FileTask(scene(bench, pictures)).photographs()
    assert "\n" not in str(caught.value)
