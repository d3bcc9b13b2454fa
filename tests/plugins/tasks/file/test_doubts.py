"""What is possible in a scene file and seldom meant is said once, in a line."""

import pytest

from plugins.new.packages import write_scene
from plugins.tasks.file.doubts import find_doubts
from tests.plugins.tasks.file.test_task import task_of

BODY = "\n  - {name: tin, cylinder: {radius: 0.03, length: 0.1}, position: [0.7, 0.2, 0.05], mass: 0.2}"


@pytest.fixture
def text(tmp_path):
    return write_scene("PushBlock", tmp_path / "push.yaml").read_text()


def doubts(tmp_path, text, body=""):
    task = task_of(tmp_path, text.replace("\nbodies:", f"\nbodies:{body}", 1), "none")
    return list(find_doubts(task.scene(0)))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "mass: 0.2",
            "mass: 250",
            "body tin weighs 250 kg; grams?",
        ),
        ("length: 0.1", "length: 10", "body tin is 10 m long; millimetres?"),
        (
            "0.05]",
            "0.15]",
            "body tin begins in the air: it falls by 100 mm; a position is that of its middle",
        ),
        ("[0.7, 0.2", "[7, 0.2", "body tin begins in the air: "),
    ],
)
def test_units_that_were_mixed_up_and_bodies_in_the_air(tmp_path, text, old, new, said):
    assert doubts(tmp_path, text, BODY) == doubts(tmp_path, text) == []
    assert any(
        line.startswith(said)
        for line in doubts(tmp_path, text, BODY.replace(old, new, 1))
    )


def test_soft_bodies_in_the_air(tmp_path, text):
    elastic = "elastic: {density: 300, young: 1.0e5}"
    cloth = f"\n  - {{name: rag, cloth: {{size: [0.1, 0.1]}}, {elastic}, position: [0.6, 0.3, 0.101]}}"
    assert [line[:43] for line in doubts(tmp_path, text, cloth)] == [
        "body rag begins in the air: it falls by 100"
    ]
    assert (
        doubts(tmp_path, text, cloth.replace("position", "pinned: [0], position")) == []
    )


def test_they_are_said_once_for_a_file(tmp_path, text, caplog):
    heavy = BODY.replace("mass: 0.2", "mass: 250")
    for _ in range(2):
        task_of(tmp_path, text.replace("\nbodies:", f"\nbodies:{heavy}", 1))
    assert [record.message.partition(": ")[2] for record in caplog.records] == [
        "body tin weighs 250 kg; grams?",
        "body tin has 8.84e+05 kg/m^3; kilograms and metres are read",
    ]
