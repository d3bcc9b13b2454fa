"""What a person gets wrong with photographs is named before a model is asked again; sound benches are left alone."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from core.errors import UsageError
from core.geometry import Pose
from core.interfaces import Picture
from core.scene import Camera
from plugins.tasks.file.bench.board import find_by_board
from plugins.tasks.file.bench.drafts import BenchMistake, Draft
from plugins.tasks.file.bench.findings import judge_numbers
from plugins.tasks.file.bench.photographs import Photograph, read_photographs
from plugins.tasks.file.bench.scene_command import main
from plugins.tasks.file.bench.scene_replies import Sighting, read_reply
from plugins.tasks.file.bench.views import Landmarks, View
from plugins.tasks.file.task import FileTask
from tests.support.panda import on_panda
from tests.support.rare import rare

HERE = Path(__file__).parent
SIZE = (1280, 960)
PLACES = yaml.safe_load((HERE / "cameras.yaml").read_text())["as_stated"]
NAMES = (
    "LiftBox",
    pytest.param("TurnDisc", marks=pytest.mark.thorough),
    pytest.param("OneBook", marks=pytest.mark.thorough),
)
TARGET = (0.65, 0.0, 0.1)
BOARD = (0.45, 0.25, -20.0)


def views_of(name):
    return [View(Camera(tuple(place), TARGET, 52.0), SIZE) for place in PLACES[name]]


def draft_of(folder, name, photographs, change=None, board=()):
    """Examine an answer to a task's photographs, whose sightings are changed as if a person had made a mistake."""
    robot = on_panda(FileTask(str(HERE / "truth/TinFromShelf.yaml"))).robot
    draft = Draft(
        folder / "scene.yaml", photographs, {}, robot, 52.0, board=tuple(board)
    )
    text = (HERE / f"replies/{name}.md").read_text()
    draft.text, beside = read_reply(draft.file, text)
    sightings = [*beside.sightings, *bases(name)]
    if change is not None:
        sightings = [change(sighting) for sighting in sightings]

    draft.beside = beside.model_copy(update={"sightings": tuple(sightings)})
    draft.examine()
    return draft


def bases(name):
    """The middle of the arm's foot, as a careful person points at it."""
    for number, view in enumerate(views_of(name), 1):
        x, y = view.project(np.zeros((1, 3)))[0].tolist()
        if 0 < x < SIZE[0] and 0 < y < SIZE[1]:
            yield Sighting(body="robot_base", photo=number, pixels=(x + 5, y - 8))


def photographs_of(views):
    return [
        Photograph(Picture(b"", f"photo{number}"), SIZE, view)
        for number, view in enumerate(views, 1)
    ]


def by_board(name, lies, said):
    """Photographs whose cameras were found by a board that lies elsewhere than was said."""
    corners = np.array(
        [[x, y, 0.0] for x in (-0.09, 0, 0.09) for y in (-0.12, 0, 0.12)]
    )
    found = []
    for photograph in photographs_of(views_of(name)):
        pixels = photograph.view.project(frame(lies).apply(corners))
        landmarks = Landmarks(frame(said).apply(corners), pixels, 1.0, 12)
        found.append(photograph.find(landmarks, 52.0))
    return found


def frame(place):
    x, y, yaw = place
    return Pose.xyz_rpy((x, y, 0), (0, 0, np.radians(yaw)))


def upside_down(sighting):
    """As it is seen in a first photograph that was turned by half a circle."""
    if sighting.photo != 1:
        return sighting

    pixels = sighting.pixels
    width, height = SIZE
    if len(pixels) == 2:
        return sighting.model_copy(
            update={"pixels": (width - pixels[0], height - pixels[1])}
        )

    left, top, right, bottom = pixels
    turned = [None if x is None else width - x for x in (right, left)]
    ends = [None if y is None else height - y for y in (bottom, top)]
    return sighting.model_copy(
        update={"pixels": (turned[0], ends[0], turned[1], ends[1])}
    )


@pytest.mark.parametrize("name", NAMES)
def test_a_sound_bench_raises_no_alarm(tmp_path, name):
    assert draft_of(tmp_path, name, photographs_of(views_of(name))).faults == []


@pytest.mark.parametrize("name", NAMES)
def test_swapped_cameras_are_named(tmp_path, name):
    swapped = photographs_of(reversed(views_of(name)))
    with pytest.raises(BenchMistake, match=r"photo1 and photo2 are swapped"):
        draft_of(tmp_path, name, swapped)


@pytest.mark.thorough
@pytest.mark.parametrize("name", NAMES)
def test_a_photograph_that_is_upside_down_is_named(tmp_path, name):
    photographs = photographs_of(views_of(name))
    with pytest.raises(BenchMistake, match=r"photo1 is upside down"):
        draft_of(tmp_path, name, photographs, upside_down)


LIES = {
    "other_way": ((0.45, 0.25, 20.0), r"board=\[0\.45,0\.25,20\]"),
    "other_side": ((0.45, -0.25, -20.0), r"board=\[0\.45,-0\.25,-20\]"),
    "half_a_circle": ((0.45, 0.25, 160.0), r"board=\[0\.45,0\.25,160\]"),
}


@pytest.mark.parametrize("how", rare(LIES, "other_way"))
def test_a_board_that_lies_otherwise_is_named_with_what_to_type(tmp_path, how):
    lies, words = LIES[how]
    pytest.importorskip("cv2")
    photographs = by_board("LiftBox", lies, BOARD)
    with pytest.raises(BenchMistake, match=words):
        draft_of(tmp_path, "LiftBox", photographs, board=BOARD)


def test_a_board_that_lies_as_was_said_raises_no_alarm(tmp_path):
    pytest.importorskip("cv2")
    photographs = by_board("LiftBox", BOARD, BOARD)
    assert draft_of(tmp_path, "LiftBox", photographs, board=BOARD).faults == []


@pytest.mark.thorough
def test_photographs_of_two_benches_are_named(tmp_path):
    def mix(sighting):
        if sighting.photo == 1 or sighting.body == "robot_base":
            return sighting

        # All of the bench lies elsewhere, each body in another direction.
        shift = 120 if len(sighting.body) % 2 else -150
        pixels = [None if x is None else x + shift for x in sighting.pixels]
        return sighting.model_copy(update={"pixels": tuple(pixels)})

    with pytest.raises(BenchMistake, match="photo2 shows another bench than photo1"):
        draft_of(tmp_path, "OneBook", photographs_of(views_of("OneBook")), mix)


def test_a_body_that_is_marked_as_seen_needs_a_sighting(tmp_path):
    draft = Draft(
        tmp_path / "scene.yaml", photographs_of(views_of("LiftBox")), {}, None, None
    )
    before = draft.read_numbers()
    text = (HERE / "replies/LiftBox.md").read_text()
    draft.text, draft.beside = read_reply(draft.file, text)
    assert list(draft.find_unsighted(before)) == []

    elsewhere = [s for s in draft.beside.sightings if s.body != "carton"]
    draft.beside = draft.beside.model_copy(update={"sightings": tuple(elsewhere)})
    (line,) = draft.find_unsighted(before)
    assert "carton is marked # seen, and no sighting says where" in line
    # What stood in the file before was seen before.
    assert list(draft.find_unsighted(draft.read_numbers())) == []


def test_a_mirrored_photograph_of_the_board_is_named(tmp_path):
    cv2 = pytest.importorskip("cv2")
    main([f"print_board={tmp_path}/board.png"])
    sheet = cv2.imread(f"{tmp_path}/board.png")
    cv2.imwrite(
        f"{tmp_path}/photo.png", cv2.resize(sheet, None, fx=0.3, fy=0.3)[:, ::-1]
    )
    photographs = read_photographs([f"{tmp_path}/photo.png"], [])
    with pytest.raises(UsageError, match="photo1 is mirrored"):
        find_by_board(photographs, (0.5, -0.2, 90), 52.0)


@pytest.mark.thorough
def test_a_photograph_without_a_board_is_placed_by_what_it_shares(tmp_path):
    pytest.importorskip("cv2")
    first, second = photographs_of(views_of("LiftBox"))
    alone = Photograph(second.picture, SIZE)
    draft = draft_of(tmp_path, "LiftBox", [first, alone])
    assert draft.faults == []
    place = draft.fitted[1].view.camera.position
    assert np.linalg.norm(np.subtract(place, second.view.camera.position)) < 0.12


def test_what_no_known_camera_shows_is_a_guess(tmp_path):
    name = "LiftBox"
    bare = [Photograph(photo.picture, SIZE) for photo in photographs_of(views_of(name))]
    guessed = {
        verdict.name
        for verdict in judge_numbers(draft_of(tmp_path, name, bare))
        if verdict.source == "guessed"
    }
    assert "carton" in guessed
    known = judge_numbers(draft_of(tmp_path, name, photographs_of(views_of(name))))
    places = [verdict for verdict in known if verdict.kind == "place"]
    assert {verdict.source for verdict in places} <= {"measured", "assumed"}
    assert all(verdict.photos for verdict in places if verdict.source == "measured")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("board=[46,27,-20]", r"board=\[0\.46,0\.27,-20\]"),
        ("board=[460,270,-20]", r"board=\[46?0?.*\]"),
        ("known={mug.height: 95}", r"0\.095"),
        ("known={ball.radius: 2.4}", r"of centimetres 0\.024"),
        ("known={jar.height: 9.5}", r"of centimetres 0\.095"),
    ],
)
def test_lengths_of_another_unit_are_refused_with_the_words_to_type(
    tmp_path, monkeypatch, words, said
):
    pytest.importorskip("cv2")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=said):
        main(["Lift the mug up", words, "vlm=mailbox", "output=x.yaml"])


def test_the_boards_markers_have_the_width_that_they_were_printed_with():
    with pytest.raises(UsageError, match="board_marker_mm"):
        find_by_board([], (0.4, 0.2, 0.0), marker_mm=0.0)
