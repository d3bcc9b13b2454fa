"""The page of a scene: what a plan says of a body that is turned."""

from plugins.tasks.file.bench.bench_page import draw_page
from plugins.tasks.file.task import FileTask
from tests.support.panda import on_panda

TURNED = """
name: Turned
description: A long bar lies on the table, turned. Bring it onto the mark.
bodies:
  - {name: bar, box: [0.3, 0.04, 0.02], position: [0.6, 0.1, 0.01], rpy_deg: [0, 0, 45], mass: 0.2}
marks:
  - {name: mark, position: [0.5, -0.2, 0], radius: 0.05}
goals:
  - {bodies: [bar], at: mark, place: [0, 0, null], tolerance: 0.02}
"""


def test_a_plan_gives_the_own_measures_of_a_turned_body(tmp_path):
    (tmp_path / "turned.yaml").write_text(TURNED)
    task = on_panda(FileTask(str(tmp_path / "turned.yaml")))
    page = draw_page(task, [], [], None, [])
    assert "bar: 300 x 40 x 20 mm, turned by 45 deg, at (600, 100)" in page
    assert "bar: 300 x 40 x 20 mm, turned by 45 deg, at (600, 10)" in page
