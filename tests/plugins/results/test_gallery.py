"""The gallery: the best tools of each task, as files that a slicer reads and a page that a browser shows."""

import json
import re

import numpy as np
import pytest
import trimesh
from PIL import Image

from core.errors import UserError
from plugins.results.gallery import gallery, main
from plugins.results.workshop.settings import Printer
from tests.commands import python_m
from tests.core.browser import complaints, opened, requests, screenshot
from tests.core.run_folders import edit, hook, write_run

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    root = tmp_path_factory.mktemp("gallery")
    short, long_, other = hook(0.1, "short"), hook(0.6, "long one"), hook(0.2, "<b>../../x</b>")
    write_run(root / "runs" / "a", "seed=0", rewards=[[0.3, 0.9, 0.5]], tools=[short, long_, other])
    write_run(root / "runs" / "b", "seed=1", rewards=[[0.8, 0.2, 0.1]], tools=[short, long_, other])
    write_run(root / "runs" / "c", "task=OneBook", rewards=[[0.4]], tools=[short])
    write_run(root / "runs" / "d", "task=OneBook", "tool=none", rewards=[[0.6]])
    write_run(root / "runs" / "killed", "seed=2", rewards=[[1.0]], finish=False)
    entries, left_out = gallery([root / "runs"], root / "out", 2, Printer())
    return root / "out", entries, left_out


def test_the_best_of_each_task_are_chosen_each_once(made):
    _, entries, left_out = made
    assert [(e.winner.run.task, e.place, e.winner.name, e.winner.reward) for e in entries] == [
        ("BringCube", 1, "long one", 0.9),
        ("BringCube", 2, "short", 0.8),
        ("OneBook", 1, "short", 0.4),
    ]
    assert [run.status for run in left_out] == ["unfinished"]


def test_a_tool_that_is_hardly_another_takes_no_place(tmp_path):
    tools = [hook(0.3, "best"), hook(0.304, "its copy"), hook(0.35, "longer"), hook(0.2, "shorter")]
    write_run(tmp_path / "run", rewards=[[0.9, 0.8, 0.7, 0.6]], tools=tools)
    chosen, _ = gallery([tmp_path / "run"], tmp_path / "out", 3, Printer())
    assert [entry.winner.name for entry in chosen] == ["best", "longer", "shorter"]


def test_files_for_the_printer(made):
    out, _, _ = made
    folder = out / "BringCube" / "2_short"
    assert {file.name for file in folder.iterdir()} == {"picture.png", "tool.stl", "tool.3mf", "design.json"}
    for name in ("tool.stl", "tool.3mf"):
        mesh = trimesh.load_mesh(folder / name)
        mesh = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh
        assert mesh.is_volume
        assert 90 < mesh.extents.max() < 120  # millimetres
        assert mesh.bounds[0][2] == pytest.approx(0, abs=1e-4)
    picture = np.asarray(Image.open(folder / "picture.png"))
    assert picture.shape == (480, 640, 4)
    assert 0.01 < (picture[..., 3] > 0).mean() < 0.9


def test_a_tools_design_can_be_tried_again(made, tmp_path):
    design = made[0] / "OneBook" / "1_short" / "design.json"
    words = ["task=OneBook", f"designs={design}", "output=again.json", "executor.workers=1"]
    done = python_m(tmp_path, "core.evaluate", *words)
    assert done.returncode == 0, done.stderr
    (record,) = json.loads((tmp_path / "again.json").read_text())
    assert record["status"] == "ok"


def test_what_is_checked_stands_beside_each_tool(made):
    _, entries, _ = made
    assert [(e.winner.name, e.ready) for e in entries] == [("long one", True), ("short", True), ("short", True)]
    assert [piece.name for piece in entries[0].pieces] == ["tool_1", "tool_2", "tool_3"]  # as an export cuts it
    checks = {check.name: check.passed for check in entries[0].pieces[0].checks}
    assert checks == {"watertight": True, "one piece": True, "walls": True, "fits the plate": True}


def test_what_spoke_against_candidates_is_on_the_page(tmp_path):
    write_run(tmp_path / "run", rewards=[[0.3, None, None]])
    gallery([tmp_path / "run"], tmp_path / "out", 3, Printer())
    assert "<li>2 times, first g0-a0-s1-p0: it is too heavy</li>" in (tmp_path / "out" / "index.html").read_text()


def test_names_that_models_wrote_stay_in_the_gallery(tmp_path):
    tools = [hook(0.1, "../../<script>alert(1)</script>"), hook(0.2, "///"), hook(0.3, "ß" * 199)]
    write_run(tmp_path / "runs", rewards=[[0.3, 0.2, 0.1]], tools=tools)
    gallery([tmp_path / "runs"], tmp_path / "out" / "deep", 3, Printer())
    assert {path.name for path in tmp_path.iterdir()} == {"runs", "out"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"deep"}
    folders = {path.name for path in (tmp_path / "out" / "deep" / "BringCube").iterdir()}
    assert folders == {"1_script_alert_1_script", "2_tool", "3_tool"}
    assert "<script>alert" not in (tmp_path / "out" / "deep" / "index.html").read_text()


def test_nothing_to_show(tmp_path):
    write_run(tmp_path / "runs", "tool=none", rewards=[[0.3]])
    with pytest.raises(UserError, match="no tool to show: 1 finished runs, all with the bare hand"):
        gallery([tmp_path / "runs"], tmp_path / "out", 3, Printer())


def test_the_page(made):
    out, _, _ = made
    text = (out / "index.html").read_text()
    files = {str(file.relative_to(out)) for folder in out.glob("*/*") for file in folder.iterdir()}
    assert len(files) == 3 * 4 + 2
    assert set(re.findall(r'<a [^>]*href="([^"#]+)"', text)) == files | {f"../runs/{run}" for run in "abc"}
    for dark, width in ((False, 1200), (True, 390)):
        with opened(out / "index.html", width, dark=dark) as chrome:
            assert complaints(chrome) == []
            assert requests(chrome) == [(out / "index.html").resolve().as_uri()]
            assert chrome.execute_script("return document.documentElement.scrollWidth") == width
            script = "return Array.from(document.images, (i) => i.naturalWidth)"
            assert chrome.execute_script(script) == [640, 640, 640]
            chrome.execute_script("document.querySelector('[data-tool=\"1\"]').click()")
            canvas = chrome.find_element("css selector", ".viewer canvas")
            assert chrome.find_element("css selector", "select").get_property("selectedIndex") == 1
            pixels = screenshot(chrome, canvas).astype(int)
            assert (np.abs(pixels - pixels[5, 5]).sum(axis=-1) > 30).mean() > 0.01


def test_the_command(tmp_path):
    write_run(tmp_path / "run", rewards=[[0.25]], tools=[hook(0.1, "[bold]rod[/]")])
    done = python_m(tmp_path, "core", "gallery", "run", "output=out", "plate_mm=[20,20,20]")
    assert done.returncode == 0, done.stderr
    assert "[bold]rod[/]" in done.stdout
    assert "fits the plate" in done.stdout
    assert done.stdout.splitlines()[-1] == "out/index.html"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "no folder given; usage: "),
        (["nowhere"], "no folder nowhere"),
        (["runs=nowhere"], "no folder nowhere"),
        (["run", "top=0"], "top must be at least 1, got 0"),
        (["run", "plate_mm=[1,2]"], "plate_mm must be three lengths"),
        (["run", "min_wall=1"], "no key 'min_wall' in the configuration (did you mean 'min_wall_mm'?)"),
    ],
)
def test_mistakes(tmp_path, monkeypatch, words, said):
    (tmp_path / "run").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=re.escape(said)):
        main(words)


def test_a_damaged_run_costs_itself_alone(tmp_path, monkeypatch, capsys):
    write_run(tmp_path / "runs" / "sound", rewards=[[0.5]])
    write_run(tmp_path / "runs" / "flipped", "seed=1", rewards=[[0.6]])
    write_run(tmp_path / "runs" / "foreign", "seed=2", rewards=[[0.7]])
    edit(tmp_path / "runs" / "flipped", "UPDATE evaluations SET reward = 'much'")
    edit(tmp_path / "runs" / "foreign", 'UPDATE strategies SET design = \'{"gripper": false, "tool_urdf": "<link/>"}\'')
    monkeypatch.chdir(tmp_path)
    main(["runs"])
    *_, first, second, page = capsys.readouterr().out.splitlines()
    assert "not counted, unreadable: runs/flipped: " in first
    assert "row 1 of evaluations: reward: Input should be a valid number" in first
    assert "not counted, unreadable: runs/foreign: the design of g0-a0-s0-p0 can't be read again: " in second
    assert page == "gallery/index.html"
