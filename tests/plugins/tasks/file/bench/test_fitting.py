"""A bench whose cameras were measured by hand, each 7 mm and 1 degree off, through a lens that bends.

The answer was written by hand from photographs of another renderer.
"""

from pathlib import Path

import numpy as np
import pytest

from core.interfaces import Picture
from core.scene import Camera
from plugins.tasks.file.bench.drafts import BenchMistake, Draft
from plugins.tasks.file.bench.findings import describe_fit
from plugins.tasks.file.bench.fitting import measure_off, place_points
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.scene_replies import Beside, Sighting, read_reply
from plugins.tasks.file.bench.views import CameraError, View
from plugins.tasks.file.task import FileTask
from tests.support.panda import on_panda
from tests.support.scene_files import true_task

REPLY = Path(__file__).parent / "replies/RollToStripe.md"
SIZE = (1280, 960)
MEASURED = (
    Camera((1.47, -0.755, 0.815), (0.69, -0.03, 0.0), 50.0),
    Camera((1.51, 0.815, 0.91), (0.715, 0.01, 0.0), 50.0),
)
TRUE = {
    "bodies.channel.position.x": 0.90749,
    "bodies.channel.position.y": -0.02877,
    "bodies.channel.rpy_deg.yaw": -4.76384,
    "bodies.ball.position.x": 0.89919,
    "bodies.ball.position.y": -0.19475,
    "bodies.ball.sphere": 0.02734,
    "bodies.jar.position.x": 0.65457,
    "bodies.jar.position.y": 0.19853,
    "bodies.jar.cylinder.radius": 0.04709,
    "bodies.jar.cylinder.length": 0.14432,
    "marks.stripe.position.x": 0.91822,
    "marks.stripe.position.y": 0.09995,
}

CHANNEL = """
name: RollToStripe
description: A ball lies in a channel. Roll it to the other end.
bodies:
  - name: channel
    fixed: true
    position: [0.7, 0, 0]  # told
    parts:
      - {{box: [0.1, 0.4, 0.006], position: [0, 0, 0.003]}}  # told
      - {{box: [0.008, 0.4, 0.03], position: [0.046, 0, 0.021]}}  # told
      - {{box: [0.008, 0.4, 0.03], position: [-0.046, 0, 0.021]}}  # told
  - name: ball
    sphere: {radius}  # seen
    position: [{x}, -0.1, {z}]  # seen
    mass: 0.05  # assumed
goals:
  - {{bodies: [ball], at: channel, place: [0, 0.15, null], tolerance: 0.025, rest: true}}
"""


def examine_ball(folder, x, z, channel=CHANNEL, radius=0.023):
    """Examine a channel that was measured and a ball in it whose place was said to be (x, -0.1, z)."""
    true = folder / "true.yaml"
    true.write_text(channel.format(radius=0.02, x=0.71, z=0.0261))
    views = [View(camera, SIZE) for camera in MEASURED]
    scene = FileTask(str(true)).scene(0)
    sightings = list[Sighting]()
    for number, view in enumerate(views, 1):
        blank = Sighting(body="ball", photo=number, pixels=(0.0, 0.0, 0.0, 0.0))
        sides = measure_off(place_points(scene, blank), blank, view).tolist()
        sightings.append(blank.model_copy(update={"pixels": tuple(sides)}))

    error = CameraError(place_m=0.001, turn_deg=0.1, fov_deg=0.1, bend=0.001)
    photographs = [Photograph(Picture(b""), SIZE, view, error=error) for view in views]
    robot = on_panda(true_task("BringCube")).robot
    text = channel.format(radius=radius, x=x, z=z)
    draft = Draft(folder / "scene.yaml", photographs, {}, robot, None, text)
    draft.beside = Beside(sightings=tuple(sightings))
    draft.examine()
    return draft


@pytest.mark.parametrize(
    ("x", "z"),
    [
        pytest.param(0.62, 0.0291, id="beside"),
        pytest.param(0.6265, 0.0291, id="at_the_outside"),
        pytest.param(0.7, 0.037, id="in_the_air"),
        pytest.param(0.7, 0.0251, id="in_the_floor_by_4_mm"),
    ],
)
def test_a_ball_finds_its_channel_and_rests_in_it(tmp_path, x, z):
    draft = examine_ball(tmp_path, x, z)
    assert draft.faults == []

    values = draft.fit.values
    assert values["bodies.ball.position.x"] == pytest.approx(0.71, abs=0.004)
    assert values["bodies.ball.sphere"] == pytest.approx(0.02, abs=0.002)
    # Nothing is as sure as that it lies on the channel's floor.
    heights = np.array(draft.fit.benches["bodies.ball.position.z"])
    radii = np.array(draft.fit.benches["bodies.ball.sphere"])
    assert heights - radii == pytest.approx(0.006, abs=5e-4)
    assert len(heights) == 64
    # Few draws are as wide as what fits, whatever the luck.
    forward = np.array(draft.fit.benches["bodies.ball.position.x"])
    assert forward.mean() == pytest.approx(forward[0], abs=0.05 * forward.std())


def test_what_was_assumed_is_lifted_out_of_what_bears_it(tmp_path):
    marked = CHANNEL.replace("{z}]  # seen", "{z}]  # assumed")
    draft = examine_ball(tmp_path, 0.7, 0.0251, marked)
    assert draft.faults == []

    values = draft.fit.values
    height = values["bodies.ball.position.z"]
    assert height - values["bodies.ball.sphere"] == pytest.approx(0.006, abs=2e-4)


def test_what_a_person_measured_stays_where_it_is_wrong(tmp_path):
    marked = CHANNEL.replace("{z}]  # seen", "{z}]  # told")
    marked = marked.replace("{radius}  # seen", "{radius}  # told")
    draft = examine_ball(tmp_path, 0.7, 0.0251, marked)
    assert any("channel and ball overlap by 4 mm" in line for line in draft.faults)


def test_a_told_size_that_photographs_contradict_is_named(tmp_path):
    marked = CHANNEL.replace("{radius}  # seen", "{radius}  # told")
    words = r"ball\.sphere is told as 0\.03, and the photographs show 0\.0(2|19)"
    with pytest.raises(BenchMistake, match=words):
        examine_ball(tmp_path, 0.7, 0.036, marked, radius=0.03)

    assert examine_ball(tmp_path, 0.7, 0.026, marked, radius=0.02).faults == []


STAND = """
name: Stand
description: A post stands on a plate. Leave it there.
bodies:
  - name: stand
    position: [0.7, 0, 0]  # told
    mass: 1  # assumed
    parts:
      - {{box: [{plate}, 0.1, 0.02], position: [0, 0, 0.01]}}  # seen, told, told, told
      - {{box: [{post}, 0.05, 0.1], position: [0, 0, 0.07]}}  # seen, told, told, told
goals:
  - {{bodies: [stand], place: [0.6, 0, null], tolerance: 0.02}}
"""


@pytest.mark.parametrize("both", [True, False])
def test_parts_have_proportions_of_their_own_where_each_is_seen(tmp_path, both):
    file = tmp_path / "scene.yaml"
    file.write_text(STAND.format(plate=0.14, post=0.03))
    scene = FileTask(str(file)).scene(0)
    sightings = []
    views = [View(camera, SIZE) for camera in MEASURED]
    for number, view in enumerate(views, 1):
        for part in (0, 1) if both else (0,):
            for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
                blank = Sighting(
                    body="stand",
                    photo=number,
                    pixels=(0, 0),
                    point=(x, y, 1),
                    part=part,
                )
                off = measure_off(place_points(scene, blank), blank, view)
                sightings.append(
                    blank.model_copy(update={"pixels": tuple(off.tolist())})
                )

    photographs = [Photograph(Picture(b""), SIZE, view) for view in views]
    robot = on_panda(true_task("BringCube")).robot
    text = STAND.format(plate=0.12, post=0.04)
    draft = Draft(file, photographs, {}, robot, None, text)
    draft.beside = Beside(sightings=tuple(sightings))
    draft.examine()
    sizes = [draft.fit.values[f"bodies.stand.parts.{part}.box.x"] for part in (0, 1)]
    assert sizes[0] == pytest.approx(0.14, abs=0.003)
    # A part that was not seen keeps the proportions that were said.
    assert sizes[1] == pytest.approx(0.03 if both else 0.0467, abs=0.003)


@pytest.mark.thorough
@pytest.mark.slow
def test_true_values_are_inside_of_what_fits(tmp_path):
    views = [View(camera, SIZE) for camera in MEASURED]
    photographs = [Photograph(Picture(b"", "photo"), SIZE, view) for view in views]
    robot = on_panda(true_task("BringCube")).robot
    draft = Draft(tmp_path / "scene.yaml", photographs, {}, robot, None)
    draft.text, draft.beside = read_reply(draft.file, REPLY.read_text())
    draft.examine()
    assert draft.faults == []

    benches = draft.fit.benches
    outside = [
        path
        for path, true in TRUE.items()
        if not min(benches[path]) <= true <= max(benches[path])
    ]
    assert outside == []
    # What nobody could know better than that is not claimed, and neither is less.
    spread = np.ptp(benches["bodies.ball.position.x"])
    assert 0.02 < spread < 0.09

    # The ball lies on the channel's floor in every bench, and the file says them.
    draft.vary()
    draft.file.write_text(draft.text)
    task = FileTask(str(draft.file), "seen")
    for seed in range(64):
        ball = task.scene(seed)["ball"]
        radius = ball.collisions[0].shape.radius
        assert ball.pose.position[2] == pytest.approx(0.006 + radius, abs=3e-4)
        drawn = task.draw(seed)("bodies.ball.sphere", 0)
        assert drawn == pytest.approx(benches["bodies.ball.sphere"][seed], abs=1e-5)

    *moved, together = describe_fit(photographs, draft.fit)
    assert len(moved) == 2
    assert all("the fit moved its camera by" in line for line in moved)
    assert "all places together may lie up to" in together
