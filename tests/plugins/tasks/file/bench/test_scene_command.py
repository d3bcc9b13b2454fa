"""``vlmgineer scene`` from a sentence to a file, with a thread in the place of the person at the mailbox."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from core.errors import UserError
from plugins.tasks.file.bench.scene_command import main
from plugins.tasks.file.scene_warnings import bound
from plugins.tasks.file.task import FileTask
from tests.support.rare import rare

HERE = Path(__file__).parent
BAD = yaml.safe_load((HERE / "bad.yaml").read_text())
CAMERAS = yaml.safe_load((HERE / "cameras.yaml").read_text())
CUBE = """
name: Cube
description: A red cube lies on the table. Bring it onto the mark.
bodies:
  - name: cube
    box: [0.07, 0.07, 0.07]  # seen
    position: [1.0, 0, 0.035]  # seen
    mass: 0.3  # assumed
marks:
  - {name: mark, position: [0.6, 0, 0], radius: 0.05}  # assumed
goals:
  - {bodies: [cube], at: mark, place: [0, 0, null], tolerance: 0.02}
"""


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Image.new("RGB", (64, 48), "gray").save("nothing.png")
    Image.linear_gradient("L").resize((1280, 960)).save("bench.png")
    Path("folder.yaml").mkdir()
    Path("text.png").write_text("no picture")
    return tmp_path


def answer(folder, replies):
    """Answer each request that comes into a mailbox with the next reply."""

    def work():
        for reply in replies:
            waiting = []
            while not waiting:
                time.sleep(0.02)
                prompts = folder.glob("*/prompt.md")
                files = [prompt.with_name("reply.md") for prompt in prompts]
                waiting = [file for file in files if not file.exists()]
            waiting[0].write_text(reply)

    threading.Thread(target=work, daemon=True).start()


def write_scene(*words, replies, folder):
    """Call the command with a mailbox that is answered; return the prompts' texts."""
    answer(folder, replies)
    main([*words, "vlm=mailbox", "vlm.poll_s=0.02"])
    return [file.read_text() for file in folder.glob("*/prompt.md")]


@pytest.mark.slow
def test_a_scene_is_written_changed_and_replayed(bench, capsys):
    sentence = "Bring the red cube onto the blue mark, gently."
    told = CUBE.replace("mass: 0.3  # assumed", "mass: 0.4  # told")
    replies = [CUBE, f"So:\n```yaml{told}```\n\n```yaml\nunsaid: [gently]\n```\n"]
    words = [sentence, "known={cube.mass: 0.4}"]
    prompts = write_scene(*words, replies=replies, folder=bench / "mailbox")

    assert all(sentence in prompt for prompt in prompts)
    assert any("cube.mass is told as 0.4" in prompt for prompt in prompts)
    file = bench / "my_scene.yaml"
    assert file.read_text().startswith("# not said: gently\nname: Cube\n")
    assert FileTask("my_scene.yaml").scene(0)["cube"].mass == 0.4
    said = capsys.readouterr().out
    assert "cube must get to (0, 0, any z) in the frame of mark" in said
    assert "not said: gently" in said
    assert "<polygon" in Path("my_scene.html").read_text()

    # What was answered is not asked for again, and can be replayed elsewhere.
    main([*words, "vlm=replay", "vlm.run=my_scene", "output=other.yaml"])
    assert Path("other.yaml").read_text() == file.read_text()

    moved = file.read_text().replace(
        "position: [1.0, 0, 0.035]  # seen", "position: [1.0, 0.04, 0.035]  # told"
    )
    sentence = "The cube is 4 cm farther left."
    strayed = moved.replace("radius: 0.05", "radius: 0.06")
    replies = [strayed, moved]
    prompts = write_scene(
        "my_scene.yaml", sentence, replies=replies, folder=bench / "mailbox"
    )
    assert any("marks.mark.radius was 0.05 and is 0.06" in text for text in prompts)
    said = capsys.readouterr().out
    assert "+     position: [1.0, 0.04, 0.035]  # told" in said
    assert file.read_text() == moved


@pytest.mark.parametrize(
    ("words", "old", "new", "line"), rare(map(tuple, BAD), *map(tuple, BAD[::4]))
)
def test_a_bad_sentence_or_answer_is_explained(bench, words, old, new, line):
    assert old in CUBE
    reply = CUBE.replace(old, new, 1)
    if not old:
        reply = new or CUBE
    words = ["vlm=mailbox", "vlm.poll_s=0.02", "tries=1", *words]
    if "vlm=offline" in words:
        words = words[3:]
    answer(bench / "mailbox", [reply])
    with pytest.raises(UserError) as caught:
        main(words)
    assert line in str(caught.value)
    assert "_io." not in str(caught.value)
    assert not Path("my_scene.yaml").exists()


@pytest.mark.thorough
@pytest.mark.slow
def test_seen_numbers_vary_within_their_errors(bench):
    cameras = [
        f"{{position: {place}, target: [0.65, 0, 0.1], fov_deg: 52}}"
        for place in CAMERAS["as_stated"]["BringCube"]
    ]
    write_scene(
        "Bring the red cube onto the blue mark.",
        "pictures=[bench.png,bench.png]",
        f"cameras=[{', '.join(cameras)}]",
        "camera_error={place_m: 0.001, turn_deg: 0.1, fov_deg: 0.1, bend: 0.001}",
        replies=[(HERE / "replies/BringCube.md").read_text()],
        folder=bench / "mailbox",
    )
    file = Path("my_scene.yaml")
    task = FileTask(str(file), "seen")
    cubes = [task.scene(seed)["cube"] for seed in range(20)]
    places = [cube.pose.position for cube in cubes]
    assert 0.004 < np.ptp(places, axis=0)[0] < 0.03
    # Its size varies too, and it stands on the table all the same.
    assert 0.0005 < np.ptp(places, axis=0)[2] < 0.01
    lowest = [bound(cube)[0][2] for cube in cubes]
    assert np.abs(lowest).max() < 0.001
    assert len(task.photographs()) == 2

    # A number is changed by hand, and its range goes along.
    text = file.read_text()
    first = task.scene(0)["cube"].pose.position[0]
    place = yaml.safe_load(text)["bodies"][0]["position"]
    file.write_text(text.replace(str(place), str([place[0] - 0.1, *place[1:]])))
    main([str(file)])
    moved = FileTask(str(file), "seen").scene(0)["cube"].pose.position[0]
    assert moved == pytest.approx(first - 0.1, abs=1e-3)
