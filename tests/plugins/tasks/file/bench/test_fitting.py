"""A bench whose cameras were measured by hand, each 7 mm and 1 degree off, through a lens that bends.

The answer was written by hand from photographs of another renderer.
"""

from pathlib import Path

import numpy as np
import pytest

from core.interfaces import Picture
from core.scene import Camera
from plugins.tasks.file.bench.drafts import Draft
from plugins.tasks.file.bench.findings import describe_fit
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.replies import read_reply
from plugins.tasks.file.bench.views import View
from plugins.tasks.file.task import FileTask
from tests.panda import on_panda
from tests.plugins.tasks.file.bench.test_truth import true_task

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

    said = list(describe_fit(photographs, draft.fit))
    assert len(said) == 2
    assert all("the fit moved its camera by" in line for line in said)
