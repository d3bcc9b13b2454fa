"""Tables, figures and the page: the numbers are the runs', and nothing that a model wrote gets out of its place."""

import csv
import io
import json
import re
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest
import scipy.stats
import trimesh
from lxml import etree
from PIL import Image

from core.errors import UserError
from core.report.__main__ import main, report
from core.report.drawing import Painted, draw, painted
from core.report.figures import COLORS
from core.report.page import inline
from core.report.statistics import Resampling
from core.report.tables import Column, Link, Table, number, printed, to_csv, to_markdown
from tests.core.run_folders import hook, result, write_run

QUICK = Resampling(resamples=200)


def read_csv(file):
    with file.open(newline="", encoding="utf-8") as opened:
        return list(csv.DictReader(opened))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Runs of four methods on two tasks, two of which don't count, and the report of them."""
    root = tmp_path_factory.mktemp("report")
    rng = np.random.default_rng(0)
    finished = []
    for task in ("BringCube", "OneBook"):
        for words in ([], ["evolution=sampling"], ["tool=none", "budget.n_iteration=0"], ["tool=rlbench"]):
            if "tool=rlbench" in words and task == "OneBook":
                continue
            for seed in (0, 1):
                name = "_".join([task, *words, str(seed)])
                generations = 1 if "tool=none" in words else 3
                rewards = np.sort(rng.uniform(size=(generations, 3)), axis=0).tolist()
                distances = rng.uniform(0.3, 2, 3).tolist()
                folder = root / "runs" / name
                write_run(folder, f"task={task}", f"seed={seed}", *words, rewards=rewards, distances=distances)
                finished.append(folder)
    write_run(root / "runs" / "killed", "seed=3", rewards=[[1.0]], finish=False)
    write_run(root / "runs" / "empty", "seed=4", rewards=[[None]])
    (root / "runs" / finished[0].name / "recording.rrd").write_bytes(b"")
    results = report([root / "runs"], root / "out", ["png", "svg"], QUICK)
    return root, finished, results


# --- tables -------------------------------------------------------------------------------------------------------


def test_the_numbers_are_those_of_the_result_files(made):
    root, finished, _ = made
    rows = read_csv(root / "out" / "data" / "runs.csv")
    assert len(rows) == len(finished) == 14
    for row in rows:
        (folder,) = [f for f in finished if (root / "out" / "data" / row["folder"]).resolve() == f.resolve()]
        told = result(folder)
        assert (row["task"], int(row["seed"])) == (told["task"], told["seed"])
        assert float(row["best reward"]) == told["best"]["reward"]
        assert float(row["distance (m)"]) == told["best"]["distance_m"]
        assert (int(row["generation"]), row["candidate"]) == (told["best"]["generation"], told["best"]["candidate"])
        assert int(row["rollouts"]) == told["n_evaluations"]


def test_rewards_by_task_and_method_are_those_of_the_result_files(made):
    root, finished, _ = made
    choices = {"evolution=vlmgineer": "urdf/vlmgineer", "evolution=sampling": "urdf/sampling"}
    rows = read_csv(root / "out" / "data" / "rewards.csv")
    assert len(rows) == 7
    for row in rows:
        tool = re.search(r"tool=(none|rlbench)", row["method"])
        method = f"{tool.group(1)}/vlmgineer" if tool else choices[row["method"].split()[-1]]
        told = [result(folder) for folder in finished]
        of = [t for t in told if t["task"] == row["task"] and f"{t['tool']}/{t['evolution']}" == method]
        rewards = [t["best"]["reward"] for t in of]
        best = of[int(np.argmax(rewards))]["best"]
        assert int(row["runs"]) == len(of) == 2
        assert float(row["best"]) == max(rewards)
        assert float(row["average"]) == pytest.approx(np.mean(rewards), abs=1e-15)
        assert float(row["standard deviation"]) == pytest.approx(np.std(rewards, ddof=1), abs=1e-15)
        assert float(row["distance of the best (m)"]) == best["distance_m"]
        assert row["candidate"] == best["candidate"]


def test_methods_over_all_tasks(made):
    root, finished, _ = made
    (row,) = [r for r in read_csv(root / "out" / "data" / "methods.csv") if r["method"] == "evolution=sampling"]
    rewards = {task: [] for task in ("BringCube", "OneBook")}
    for told in (result(folder) for folder in finished):
        if told["evolution"] == "sampling":
            rewards[told["task"]].append(told["best"]["reward"])
    pooled = [reward for task in rewards.values() for reward in task]
    assert float(row["mean"]) == pytest.approx(np.mean([np.mean(task) for task in rewards.values()]))
    assert float(row["mean of the best"]) == pytest.approx(np.mean([max(task) for task in rewards.values()]))
    assert float(row["interquartile mean"]) == pytest.approx(scipy.stats.trim_mean(pooled, 0.25))
    assert float(row["IQM, low"]) <= float(row["interquartile mean"]) <= float(row["IQM, high"])
    assert row["which tasks"] == "BringCube, OneBook"


def test_by_generation(made):
    root, finished, _ = made
    rows = read_csv(root / "out" / "data" / "generations.csv")
    of = [r for r in rows if r["task"] == "OneBook" and r["method"] == "evolution=sampling"]
    told = [t for t in map(result, finished) if t["task"] == "OneBook" and t["evolution"] == "sampling"]
    for index, row in enumerate(of):
        so_far = [max(g["best_reward"] for g in t["generations"][: index + 1]) for t in told]
        means = [t["generations"][index]["mean_reward"] for t in told]
        assert int(row["generation"]) == index
        assert float(row["best so far"]) == pytest.approx(np.mean(so_far))
        assert float(row["mean of the generation"]) == pytest.approx(np.mean(means))
    assert len(of) == 3


def test_a_run_that_stopped_early_keeps_its_last(tmp_path):
    write_run(tmp_path / "a", "seed=0", rewards=[[0.5], [1.0]])
    write_run(tmp_path / "b", "seed=1", rewards=[[0.1], [0.2], [0.4]])
    report([tmp_path], tmp_path / "out", ["svg"], QUICK)
    rows = read_csv(tmp_path / "out" / "data" / "generations.csv")
    assert [float(r["best so far"]) for r in rows] == pytest.approx([0.3, 0.6, 0.7])
    assert [int(r["runs"]) for r in rows] == [2, 2, 1]


def test_runs_that_do_not_count_are_listed_and_nowhere_else(made):
    root, _, results = made
    rows = read_csv(root / "out" / "data" / "left_out.csv")
    assert {(r["status"], r["task"]) for r in rows} == {("unfinished", "BringCube"), ("failed", "BringCube")}
    assert "best reward so far 1.000" in next(r["reason"] for r in rows if r["status"] == "unfinished")
    rewards = read_csv(root / "out" / "data" / "rewards.csv")
    assert max(float(r["best"]) for r in rewards) < 1
    assert sum(int(r["left out"]) for r in rewards) == 2
    assert len(results.runs) == 14


def test_all_tables_come_in_both_formats(made):
    root = made[0]
    names = {"rewards", "methods", "improvements", "generations", "tools", "runs", "left_out", "parameters", "costs"}
    names |= {"versions"}
    assert {f.stem for f in (root / "out" / "data").glob("*.csv")} == names
    assert {f.stem for f in (root / "out" / "data").glob("*.md")} == names
    text = (root / "out" / "data" / "parameters.md").read_text()
    assert "| BringCube | evolution=sampling |" in text


def test_links_lead_to_the_recordings(made):
    root, finished, _ = made
    rows = read_csv(root / "out" / "data" / "runs.csv")
    (row,) = [r for r in rows if r["recordings"]]
    assert (root / "out" / "data" / row["recordings"]).resolve() == (finished[0] / "recording.rrd").resolve()
    addresses = re.findall(r'href="(\.\./[^"]+)"', (root / "out" / "index.html").read_text())
    assert any(address.endswith("recording.rrd") for address in addresses)


@pytest.mark.parametrize(
    ("value", "digits", "said"),
    [(0.99996, 3, "0.999"), (1.0, 3, "1.000"), (0.12345, 3, "0.123"), (float("nan"), 2, "–"), (12.6, 0, "13")],
)
def test_nothing_is_rounded_up_to_one(value, digits, said):
    assert number(value, digits) == said


def test_cells_in_a_file_of_commas_and_in_markdown(tmp_path):
    columns = (Column("text"), Column("number", 2), Column("link"))
    rows = (("=1+1|\x1b[31m\n*b*", 1 / 3, Link("a|b", tmp_path / "x" / "y")), ("", None, ()))
    table = Table("t", "T", columns, rows, "note")
    text = to_csv(table, tmp_path / "out")
    (first, second) = csv.DictReader(io.StringIO(text))
    assert first["text"] == "'=1+1|[31m *b*"  # no formula, no escape sequence
    assert float(first["number"]) == 1 / 3
    assert first["link"] == "../x/y"
    assert second == {"text": "", "number": "", "link": ""}
    assert r"| =1+1\|\[31m \*b\* | 0.33 | a\|b |" in to_markdown(table)
    assert printed(None, columns[1]) == "–"
    with pytest.raises(ValueError, match="1 cells under 3 columns"):
        Table("t", "T", columns, (("x",),))


# --- figures ------------------------------------------------------------------------------------------------------

FIGURES = {"rewards", "deviations", "intervals", "given_tools", "generations", "generations_by_task", "gallery"}


def test_figures_are_there_and_not_blank(made):
    data = made[0] / "out" / "data"
    names = FIGURES | {"evolution_1_evolution_vlmgineer"}
    assert {f.stem for f in data.glob("*.png")} == {f.stem for f in data.glob("*.svg")}
    assert {f.stem for f in data.glob("*.png")} >= FIGURES
    assert len(names) == len({f.stem for f in data.glob("*.png")})
    for file in data.glob("*.png"):
        picture = np.asarray(Image.open(file).convert("RGB"))
        assert min(picture.shape[:2]) > 200
        assert len(np.unique(picture[::3, ::3].reshape(-1, 3), axis=0)) > 20
        assert 0.01 < (picture != 255).any(axis=-1).mean() < 0.9


def test_bars_are_as_high_as_their_rewards(made):
    """Read back from the file: the heights of the full bars, over the height of the axis."""
    root, _, results = made
    svg = etree.parse(root / "out" / "data" / "rewards.svg")
    heights = {}
    for path in svg.iter("{*}path"):
        fill = re.search(r"fill: (#[0-9a-f]{6})", path.get("style", ""))
        if fill and fill.group(1).upper() in COLORS and "opacity" not in path.get("style"):
            corners = np.array(re.findall(r"[ML] ([\d.]+) ([\d.]+)", path.get("d")), dtype=float)
            heights.setdefault(fill.group(1).upper(), []).append(np.ptp(corners[:, 1]))
    averages = {m: [np.mean(g.rewards) for g in results.of(m)] for m in results.methods}
    bars = [heights[COLORS[i]][: len(averages[m])] for i, m in enumerate(results.methods)]
    ratio = np.concatenate(bars) / np.concatenate([averages[m] for m in results.methods])
    assert ratio == pytest.approx(np.full(len(ratio), ratio[0]), rel=1e-3)


def test_the_same_runs_give_the_same_report(made, tmp_path):
    root = made[0]
    report([root / "runs"], root / "again", [], QUICK)
    for file in sorted((root / "out").rglob("*")):
        if file.suffix in (".html", ".csv", ".md"):
            again = root / "again" / file.relative_to(root / "out")
            text = re.sub(r'<a href="data/\w+\.(png|svg)">(PNG|SVG)</a> ', "", file.read_text())
            assert again.read_text() == text, file.name  # figures are in the page


def test_one_run_is_enough_for_a_report(tmp_path):
    write_run(tmp_path / "run", rewards=[[0.5]])
    report([tmp_path / "run"], tmp_path / "out", ["png"], QUICK)
    assert {f.stem for f in (tmp_path / "out" / "data").glob("*.png")} == {
        "rewards",
        "deviations",
        "intervals",
        "gallery",
    }
    assert read_csv(tmp_path / "out" / "data" / "methods.csv")[0]["IQM, low"] == ""


@pytest.mark.slow
def test_more_methods_than_colours(tmp_path):
    for n in range(9):
        write_run(tmp_path / str(n), f"budget.n_agent={n + 1}", rewards=[[0.1 * n]])
    results = report([tmp_path], tmp_path / "out", ["svg"], QUICK)
    assert len(results.methods) == 9
    assert "url(#h" in (tmp_path / "out" / "data" / "rewards.svg").read_text()  # hatched


# --- drawings -----------------------------------------------------------------------------------------------------


def test_a_tool_is_drawn_in_its_colours_with_its_edges():
    picture = draw(painted(hook(0.3)), 240, 180)
    assert picture.shape == (180, 240, 4)
    alpha = picture[..., 3]
    assert alpha[0].max() == alpha[:, 0].max() == alpha[-1].max() == 0  # it fits
    seen = picture[alpha == 255][:, :3].astype(int)
    assert 0.02 < (alpha > 0).mean() < 0.5
    assert (seen[:, 2] > seen[:, 0] + 60).any()  # the blue of a component
    assert (np.ptp(seen, axis=1) < 20).any()  # the grey of the flange
    assert (seen.sum(axis=1) < 150).any()  # edges


def test_what_is_nearer_hides_what_is_behind():
    toward = np.array([0.52, -0.74, 0.42])  # the eye
    red = Painted(trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation(0.2 * toward), (0.9, 0.1, 0.1, 1.0))
    blue = Painted(trimesh.creation.box((0.2, 0.2, 0.2)).apply_translation(-0.2 * toward), (0.1, 0.1, 0.9, 1.0))
    for order in ([red, blue], [blue, red]):
        picture = draw(order, 200, 200).astype(int)
        assert picture[100, 100, 0] > picture[100, 100, 2] + 60  # red, in the middle
        assert (picture[..., 2] > picture[..., 0] + 60).any()


def test_the_hand_is_drawn_for_a_gripper(tmp_path):
    from core.design import Tool

    picture = draw(painted(Tool(gripper=True)))
    assert (picture[..., 3] > 0).any()


# --- the page -----------------------------------------------------------------------------------------------------

HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'>{{ 7 * 7 }}</title>$\\frac{1}{2}$\x1b[31m\u202e\x00"


class Page(HTMLParser):
    """Elements and attributes as a browser sees them."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.text = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, *attr) for attr in attrs]

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    """A report of a run whose texts are an attack, in a folder whose name is one."""
    root = tmp_path_factory.mktemp("hostile")
    folder = root / "runs" / "javascript:alert(1) <b>&\"'\x1b[31m\u202e"
    write_run(folder, rewards=[[0.5], [0.7]], tools=[hook(0.2, HOSTILE, HOSTILE)], name=HOSTILE)
    bad = write_run(root / "runs" / "<i>bad", rewards=[[0.5]])
    (bad / "result.json").write_text(json.dumps(result(bad) | {"seed": HOSTILE}))
    report([root / "runs"], root / "out", ["svg"], QUICK)
    return root / "out"


def test_what_a_model_wrote_stays_text(hostile):
    text = (hostile / "index.html").read_text()
    page = Page(text)
    assert page.tags.count("script") == 2  # the tools' data, and the page's own
    assert "img" not in page.tags
    assert not [a for a in page.attributes if a[1].startswith("on")]
    assert "<script>alert" not in text
    assert "{{ 7" in text  # no template of ours read it
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]", text)
    assert any("alert(1)" in piece for piece in page.text)


def test_links_stay_inside_files(hostile):
    page = Page((hostile / "index.html").read_text())
    addresses = [value for tag, key, value in page.attributes if tag == "a" and key == "href"]
    assert addresses
    for address in addresses:
        assert address.startswith(("#", "data/", "../")), address


def test_tables_and_figures_of_a_hostile_run(hostile):
    for file in (hostile / "data").iterdir():
        text = file.read_text()
        assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f\u202e]", text), file.name
    assert r"\<script\>" in (hostile / "data" / "tools.md").read_text()
    etree.parse(hostile / "data" / "gallery.svg")


def test_the_page_needs_nothing_and_says_so(made):
    text = (made[0] / "out" / "index.html").read_text()
    page = Page(text)
    policy = next(v for tag, key, v in page.attributes if key == "content" and "default-src" in v)
    assert policy.startswith("default-src 'none'; img-src data:; style-src 'sha256-")
    assert "unsafe" not in policy
    loaded = [v for tag, key, v in page.attributes if key in ("src", "srcset", "data", "poster", "xlink:href")]
    loaded += [v for tag, key, v in page.attributes if key == "href" and tag != "a"]
    assert all(address.startswith(("data:", "#")) for address in loaded)
    assert "http://" not in re.sub(r'xmlns(:\w+)?="http://www\.w3\.org/[^"]+"', "", text)
    assert not [a for a in page.attributes if a[1] == "style"]  # the policy forbids them
    identities = [v for _, key, v in page.attributes if key == "id"]
    assert len(identities) == len(set(identities))


def test_figures_in_the_page_refer_to_their_own_parts(made):
    text = (made[0] / "out" / "index.html").read_text()
    identities = set(re.findall(r'\bid="([^"]+)"', text))
    used = set(re.findall(r"url\(#([^)]+)\)", text)) | set(re.findall(r'(?<=[ "])href="#([^"]+)"', text))
    assert used <= identities


def test_an_entity_in_a_figure_is_not_looked_up(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("secret")
    entity = f'<!DOCTYPE svg [<!ENTITY x SYSTEM "{secret.as_uri()}">]>'
    svg = f'{entity}<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><text>&x;</text></svg>'
    assert "secret" not in inline(svg.encode(), "n", "label")


def test_tools_that_cannot_be_shown_are_said(tmp_path):
    folder = write_run(tmp_path / "run", rewards=[[0.5]])
    (folder / "run.sqlite").unlink()
    report([folder], tmp_path / "out", ["png"], QUICK)
    assert "Tools that can&#39;t be shown: BringCube" in (tmp_path / "out" / "index.html").read_text()


# --- the command --------------------------------------------------------------------------------------------------


def call(folder, *words):
    return subprocess.run(
        [sys.executable, "-m", "core.report", *words], cwd=folder, capture_output=True, text=True, timeout=240
    )


@pytest.mark.slow
def test_the_command(tmp_path):
    """A folder's name may have a = in it, as a multirun's have."""
    write_run(tmp_path / "0_seed=0", rewards=[[0.25]])
    done = call(tmp_path, "0_seed=0", "output=out", "formats=[svg]", "resamples=100")
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    assert done.stdout.splitlines()[-1] == "out/index.html"
    assert "BringCube" in done.stdout
    assert "0.250" in done.stdout
    assert {f.suffix for f in (tmp_path / "out" / "data").iterdir()} == {".csv", ".md", ".svg"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "no folder given; usage: "),
        (["--output", "x"], "can't read '--output'; usage: "),
        (["nowhere"], "no folder nowhere"),
        (["."], "holds no run"),
        (["killed", "output=out"], "no run is finished; 1 are listed in out/index.html"),
        (["killed", "output=killed/run.sqlite"], "can't write"),
        (["killed", "format=[png]"], "no key 'format' in the configuration (did you mean 'formats'?)"),
        (["killed", "formats=[pdf]"], "no format 'pdf' in formats; possible: png, svg"),
        (["killed", "confidence=95"], "confidence must be between 0 and 1, got 95"),
        (["killed", "resamples=0"], "resamples must be at least 1, got 0"),
    ],
)
def test_mistakes(tmp_path, monkeypatch, words, said):
    if "killed" in words:
        write_run(tmp_path / "killed", finish=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["report", *words])
    with pytest.raises(UserError, match=re.escape(said)):
        main()


def test_a_mistake_is_one_line(tmp_path):
    done = call(tmp_path, "nowhere")
    assert done.returncode == 1
    assert done.stderr == "error: no folder nowhere; give the folder of a run or of a multirun\n"


def test_help(tmp_path):
    done = call(tmp_path, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("usage: python -m core.report FOLDER")
