"""The best tools of a report as files that a slicer reads."""

import re

import pytest
import trimesh

from plugins.results.report.command import report
from plugins.results.report.prints import tool_prints
from tests.commands import python_m
from tests.core.run_folders import hook, write_run

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    root = tmp_path_factory.mktemp("prints")
    short, long_ = hook(0.1, "<b>../../x</b>"), hook(0.6, "long one")
    write_run(root / "runs" / "a", "seed=0", rewards=[[0.3, 0.9]], tools=[long_, short])
    write_run(root / "runs" / "b", "task=OneBook", rewards=[[0.4]], tools=[long_])
    write_run(root / "runs" / "c", "task=MoveBall", "tool=none", rewards=[[0.6]])
    return root / "out", report([root / "runs"], root / "out")


def test_a_tool_is_one_closed_body_on_the_plate(written):
    out, _ = written
    folders = {folder.name for folder in (out / "tools").iterdir()}
    assert folders == {"1_BringCube_b_x_b", "2_OneBook_long_one"}
    folder = out / "tools" / "1_BringCube_b_x_b"
    assert {file.name for file in folder.iterdir()} == {"tool.stl", "tool.3mf", "design.json"}
    for name in ("tool.stl", "tool.3mf"):
        mesh = trimesh.load_mesh(folder / name)
        mesh = mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh
        assert mesh.is_volume
        assert mesh.body_count == 1
        assert 90 < mesh.extents.max() < 120  # millimetres
        assert mesh.bounds[0][2] == pytest.approx(0, abs=1e-4)


def test_what_speaks_against_printing_is_on_the_page(written):
    out, results = written
    short, long_ = tool_prints(results)
    assert short.ready
    assert not long_.ready
    text = (out / "index.html").read_text()
    assert text.count("✓ fits the plate: ") == 1
    assert text.count("✗ fits the plate: ") == 1
    links = set(re.findall(r'href="(tools/[^"]+)"', text))
    assert links == {str(file.relative_to(out)) for file in (out / "tools").glob("*/*")}


def test_a_tools_design_can_be_tried_again(written, tmp_path):
    design = written[0] / "tools" / "1_BringCube_b_x_b" / "design.json"
    words = ["task=BringCube", f"designs={design}", "output=again.json", "executor.workers=1"]
    done = python_m(tmp_path, "core.evaluate", *words)
    assert done.returncode == 0, done.stderr
    assert '"status": "ok"' in (tmp_path / "again.json").read_text()
