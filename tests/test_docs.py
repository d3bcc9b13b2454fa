"""Run every command in README and docs with a budget of seconds, and check every code example."""

import dataclasses
import json
import os
import re
import shlex
import tomllib
from collections import Counter
from pathlib import Path
from types import ModuleType

import nbclient
import nbformat
import numpy as np
import pytest
import yaml
from PIL import Image

from core.config.compose import load
from core.design import DesignError
from core.designs.rules import check_tool
from core.errors import UsageError
from core.geometry import Cylinder, Mesh, Sphere
from core.goals import KINDS, Reach
from core.interfaces import Seen
from core.plugins import Plugins, installed
from core.plugins.outside import is_outside
from core.plugins.registry import hints_of
from core.scene import Body, Bond, Box, Camera, Geom, Joint, Pose, Scene, State, Trace
from docs import build, gallery, names
from docs.diagrams import DRAWINGS
from plugins.commands.prompt import PromptConfig
from plugins.conformance.sample_tools import stick
from plugins.conformance.suites import examine
from plugins.new.new_command import write as write_package
from tests.core.run_folders import write_run
from tests.support import scara
from tests.support.commands import python_m, warm_python
from tests.support.outside_arm import write_arm
from tests.support.packages import install
from tests.support.panda import PANDA
from tests.support.rare import rare
from tests.support.text import replaced_all

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
NOTEBOOK = ROOT / "docs/example.ipynb"
SMALL = [
    "budget.n_agent=1",
    "budget.n_tool=1",
    "budget.n_action=2",
    "budget.n_iteration=0",
    "budget.final_s=2",
    "film=false",
]


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.DOTALL)


STARTS = ("python -m ", "vlmgineer ")


def commands():
    lines = [
        line
        for page in PAGES
        for block in blocks(page, "sh")
        for line in block.splitlines()
    ]
    return sorted({line for line in lines if line.startswith(STARTS)})


def after_python(line):
    """Return a command's words after ``python``; ``vlmgineer NAME`` is ``python -m core NAME``."""
    first, *words = shlex.split(line, comments=True)
    return ["-m", "core", *words] if first == "vlmgineer" else words


def test_there_are_commands_and_nothing_else_than_the_two_set_ups():
    others = {
        line
        for page in PAGES
        for block in blocks(page, "sh")
        for line in block.splitlines()
        if not line.startswith(STARTS)
    }
    assert len(commands()) > 5
    assert all(line.startswith("python3 -m venv .venv && ") for line in others)
    assert len(others) == 2


RUN = (  # really, of all that are composed; what they share is run once
    "vlmgineer evaluate task=BringCube designs=tests/tasks/solutions/BringCube.json output=rewards.json",
    "vlmgineer render task=BringCube designs=tests/tasks/solutions/BringCube.json output=scene.png",
)


def test_the_commands_that_are_run_are_in_the_docs():
    assert {*RUN, *LONG} <= {line.removeprefix("python -m ") for line in commands()}


LONG = (  # several runs in one, or a minute of one
    "core.run -m task=BringCube,OneBook seed=0,1",
    "core.run -m task=BringCube,OneBook seed=0,1 evolution=vlmgineer,sampling",
    "core.run task=BringCube task.variation=wide action=anchored fitness=layouts",
    "vlmgineer study paper seeds=1 tasks=BringCube methods=gripper yes=true",
    "vlmgineer prompt vlm=gemini task=PastGlasses prompt.context=pictures",
)


def by_length():
    """Yield the commands: those that are run with every test, the thorough ones, and the long ones."""
    for line in commands():
        words = line.removeprefix("python -m ")
        if words in RUN:
            yield line
        else:
            often = "weekly" if words in LONG else "thorough"
            yield pytest.param(line, marks=getattr(pytest.mark, often))


@pytest.mark.parametrize("line", [*by_length()])
def test_command(line, tmp_path):
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks" / "scenes").symlink_to(ROOT / "tasks" / "scenes")
    words = after_python(line)[1:]
    if "my_lab" in line:
        write_arm(tmp_path / "my_lab")
    if "import scara.urdf" in line:  # what the page's line before it writes
        scara.write(tmp_path / "scara.urdf")
    if words[0] == "core.run" and "--help" not in words:
        words += SMALL
    if words[:2] == ["core", "report"]:
        write_run(tmp_path / words[2] / "0")  # what the page's line before it leaves
    done = python_m(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


def compose(line):
    """Compose what a command is given; of a sweep, the first job's."""
    words = after_python(line)[1:]
    program, words = (
        words[0],
        [word for word in words[1:] if word != "-m" and not word.startswith("hydra")],
    )
    if program == "core":
        program = f"core.{words.pop(0)}"
    config, schema = {
        "core.run": ("config", None),
        "core.prompt": ("prompt", PromptConfig),
        "core.evaluate": ("evaluate", None),
    }.get(program, (None, None))
    if (
        config
        and "--help" not in words
        and not any(word.startswith("resume=") for word in words)
    ):
        load(config, [first_value(word) for word in words], schema)


def first_value(word):
    """Leave a sweep's first value: 1 of ``a=1,2`` and of ``a=interval(1,2)``."""
    if "[" in word:
        return word

    return re.sub(r"=(interval|choice)\(", "=", word).split(",")[0]


def console(page):
    """Find the blocks of commands that are not run here, each after the comment that says why."""
    return re.findall(
        r"(?:<!-- not run: (.*?) -->\n)?```console\n(.*?)```",
        page.read_text(),
        re.DOTALL,
    )


def typed(block):
    """Read the commands of a console block, with or without a prompt."""
    return [
        line.removeprefix("$ ")
        for line in block.splitlines()
        if re.match(r"(\$ )?(python -m core|vlmgineer)", line)
    ]


def test_what_is_not_run_says_why():
    for page in PAGES:
        for reason, block in console(page):
            assert reason, (
                f"{page.name}: say why this is not run in a comment '<!-- not run: ... -->' above it:\n{block}"
            )


@pytest.mark.thorough
def test_settings_of_every_command_are_there():
    lines = [
        line for page in PAGES for _, block in console(page) for line in typed(block)
    ]
    assert len(lines) > 10
    for line in [*lines, *commands()]:
        compose(line)


def test_each_kind_of_block_is_looked_at():
    """Fail on a page with a block of code that no test here knows."""
    languages = {
        page.name: Counter(re.findall(r"^```(\w+)", page.read_text(), re.MULTILINE))
        for page in PAGES
    }
    known = {"sh", "console"}
    rest = {
        name: {k: n for k, n in found.items() if k not in known}
        for name, found in languages.items()
    }
    assert {name: found for name, found in rest.items() if found} == {
        "agents.md": {"json": 3},
        "designs.md": {"json": 5},
        "paper.md": {"bibtex": 2, "yaml": 1},
        "from_photograph.md": {"yaml": 1},
        "plans.md": {"json": 3},
        "plugins.md": {"python": 4, "toml": 1},
        "layouts.md": {"json": 1},
        "looks.md": {"json": 1},
        "models.md": {"json": 1},
        "python.md": {"python": 2},
        "scene_files.md": {"yaml": 5},
        "scene_things.md": {"yaml": 4},
        "scene_types.md": {"py": 1},
        "store.md": {"python": 1},
        "strategy_tutorial.md": {"python": 1, "yaml": 1},
        "own_kinds.md": {"py": 2},
        "writing_a_scene.md": {"python": 5, "py": 4},  # the last are parts of a class
    }


def test_configurations_of_agents_programs_start_this_command():
    """Those with a command; the other names an address."""
    (desk, editor, remote) = map(json.loads, blocks(ROOT / "docs/agents.md", "json"))
    for servers in (desk["mcpServers"], editor["servers"]):
        server = servers["vlmgineer"]
        assert server["command"].endswith("vlmgineer")
        assert server["args"][0] == "mcp"

    assert remote["mcpServers"]["vlmgineer"]["url"].endswith("/mcp")


@pytest.mark.thorough
def test_the_notebook_shows_what_it_does(tmp_path):
    """Run it again: it shows outputs of the same kinds, and the rewards that its text names."""
    shown = nbformat.read(NOTEBOOK, as_version=4)
    again = nbformat.from_dict(shown)
    again = nbclient.NotebookClient(
        again, timeout=240, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    assert [kinds(cell) for cell in again.cells] == [
        kinds(cell) for cell in shown.cells
    ]
    assert NOTEBOOK.stat().st_size < 500_000
    for notebook in (shown, again):
        code = [cell for cell in notebook.cells if cell.cell_type == "code"]
        assert all(
            cell.execution_count == number for number, cell in enumerate(code, 1)
        )
        first, last = (text(code[0]), text(code[-1]).splitlines())
        best = re.fullmatch(r"16 tried, best reward (0\.9\d\d)\n", first)[1]
        assert last[0] == "0.000  flange"
        assert last[-1].startswith(best)


def kinds(cell):
    """List the kinds of output of a cell, without Pillow's JPEG beside its PNG, which is not kept."""
    outputs = cell.get("outputs", [])
    return [
        ",".join(sorted(set(out.get("data", {"text": ""})) - {"image/jpeg"}))
        for out in outputs
    ]


def text(cell):
    return "".join(out["text"] for out in cell.outputs)


def test_relative_links_lead_somewhere():
    for page in [*PAGES, *(ROOT / "docs/decisions").glob("*.md")]:
        for target in re.findall(r"\]\(((?!https?:)[^)#]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", names.WRITTEN)
def test_what_is_written_on_a_page_follows_from_the_code(page):
    """``python docs/names.py`` writes it. A name of an inner room that joins the API needs a reason."""
    _, lists, _ = names.split_page(names.page_of(page).read_text())
    assert lists == f"{names.WRITTEN[page]().strip()}\n"


def test_pictures_have_a_text_for_those_who_do_not_see_them():
    texts = {page.name: page.read_text() for page in [*PAGES, ROOT / "README.md"]}
    silent = {name for name, text in texts.items() if "![](" in text}
    assert not silent


def test_pages_are_short():
    words = {
        page: len(page.read_text().split()) for page in (ROOT / "docs").rglob("*.md")
    }
    pages = {names.page_of(name): names for name in names.WRITTEN}
    pages[gallery.PAGE] = gallery
    for page, made in pages.items():  # what is generated doesn't count
        before, _, after = made.split_page(page.read_text())
        words[page] = len(f"{before} {after}".split())
    assert {page.name: count for page, count in words.items() if count > 2000} == {}
    assert {
        page.name: count
        for page, count in words.items()
        if page.parent.name == "decisions" and count > 300
    } == {}


@pytest.mark.parametrize("name", DRAWINGS)
def test_drawings_are_up_to_date(name):
    assert (ROOT / f"docs/images/{name}.svg").read_text() == DRAWINGS[name](), (
        "python docs/build.py diagrams"
    )


def test_the_rule_of_a_lab_refuses_what_its_printer_can_not_make(monkeypatch):
    lab = ModuleType("lab")
    exec(blocks(ROOT / "docs/plugins.md", "python")[3], vars(lab))
    plugins = Plugins()
    plugins.register(lab, "lab", "this process")
    monkeypatch.setattr("core.designs.rules.installed", lambda: plugins)
    check_tool(stick(0.2), PANDA)
    with pytest.raises(DesignError, match=r"'stick' is .* long: make it of two"):
        check_tool(stick(0.3), PANDA)


def test_example_plugin_works(tmp_path, monkeypatch, capsys):
    (tmp_path / "my_plugin.py").write_text(
        blocks(ROOT / "docs/plugins.md", "python")[0]
    )
    monkeypatch.syspath_prepend(tmp_path)
    import my_plugin

    plugins = Plugins()
    plugins.register(my_plugin, "my_plugin", "this process")
    listener = plugins.create("listener", "shout", {"mark": "?"})
    listener.generation_finished(type("Generation", (), {"index": 3}))
    assert capsys.readouterr().out == "generation 3 is done?\n"
    with pytest.raises(UsageError, match="mark"):
        plugins.create("listener", "shout", {"marc": "?"})


def test_each_test_that_the_table_of_attacks_names_is_there():
    named = re.findall(
        r"`([\w/]+\.py)::(\w+)`", (ROOT / "tests/attacks/README.md").read_text()
    )
    assert len(named) > 15
    for file, name in named:
        assert f"def {name}(" in (ROOT / file).read_text(), f"{file}::{name}"


@pytest.mark.parametrize("number", rare([0, 1], 1))
def test_python_as_the_page_has_it(number, tmp_path):
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    code = blocks(ROOT / "docs/python.md", "python")[number]
    done = warm_python(["-c", code], tmp_path, os.environ)
    assert done.returncode == 0, done.stderr
    assert len(blocks(ROOT / "docs/python.md", "python")) == 2
    if number == 0:
        reward, folder = done.stdout.splitlines()[-1].split()
        assert json.loads((tmp_path / folder / "result.json").read_text())["best"][
            "reward"
        ] == float(reward)


def test_a_store_is_read_as_the_page_has_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_run(
        Path("runs/BringCube/2026-01-31_12-00-00"), rewards=((0.2, None), (0.5, 0.7))
    )
    exec(blocks(ROOT / "docs/store.md", "python")[0], {})
    assert [line.split("  ")[1] for line in capsys.readouterr().out.splitlines()] == [
        "0.700",
        "0.500",
        "0.200",
    ]


def test_the_types_of_settings_say_what_is_typed_again():
    page = ModuleType("page")
    exec(blocks(ROOT / "docs/plugins.md", "python")[1], vars(page))
    hints = hints_of(page.Pool)
    judged = {name: is_outside("text", hint) for name, hint in hints.items()}
    assert judged == {"style": False, "server": True, "members": False}
    assert is_outside([{"name": "command", "command": ["sh"]}], hints["members"])


def test_example_configs_are_found_through_the_hook(tmp_path, monkeypatch):
    folder = tmp_path / "my_task"
    (folder / "conf/task").mkdir(parents=True)
    (folder / "__init__.py").write_text(blocks(ROOT / "docs/plugins.md", "python")[2])
    monkeypatch.syspath_prepend(tmp_path)
    import my_task

    plugins = Plugins()
    plugins.register(my_task, "my_task", "this process")
    assert plugins.configs["pkg://my_task.conf"] == "this process"
    assert not [
        failure for failure in plugins.failures if failure.entry_point == "my_task"
    ]
    assert "PullBlock" in plugins.names("task")


@pytest.mark.thorough
def test_the_strategy_of_the_tutorial_passes_its_checks(tmp_path):
    """Written by `plugins.new`, changed as the page says, and installed as pip leaves it."""
    page = ROOT / "docs/strategy_tutorial.md"

    def run(*words):
        done = python_m(tmp_path, *words, PYTHONPATH=str(tmp_path / "tournament"))
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("core", "new", "strategy", "Tournament")
    package = tmp_path / "tournament"
    assert (package / "tournament/search.py").is_file()
    (package / "tournament/search.py").write_text(blocks(page, "python")[0])
    (package / "tournament/conf/evolution/Tournament.yaml").write_text(
        blocks(page, "yaml")[0]
    )
    installed = package / "tournament-0.1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: tournament\nVersion: 0.1.0\n"
    )
    (installed / "entry_points.txt").write_text(
        "[vlmgineer]\ntournament = tournament\n"
    )
    assert "ok" in run("core", "conformance", "evolution=Tournament")
    run(
        "core.run",
        "evolution=Tournament",
        "sim=mujoco",
        *SMALL,
        "budget.n_iteration=1",
        "listener=[]",
    )

    example = (ROOT / "examples/numbers_strategy.py").read_text()
    numbers = replaced_all(example, ("NumbersStrategy", "TournamentStrategy"))
    (package / "tournament/search.py").write_text(numbers)
    (package / "tournament/conf/evolution/Tournament.yaml").unlink()
    assert "ok" in run("core", "conformance", "evolution=Tournament")
    said = run(
        "core.run",
        "evolution=Tournament",
        "sim=mujoco",
        *SMALL,
        "budget.n_iteration=3",
        "listener=[]",
    )
    assert "best reward" in said


def test_the_entry_point_of_the_example_is_toml():
    (text,) = blocks(ROOT / "docs/plugins.md", "toml")
    assert tomllib.loads(text)["project"]["entry-points"]["vlmgineer"] == {
        "my_plugin": "my_plugin"
    }


def test_what_is_to_be_cited_is_the_same_everywhere():
    cff = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    method, software = blocks(ROOT / "docs/paper.md", "bibtex")
    assert cff["version"] == version
    assert f"version = {{{version}}}" in software
    (paper,) = cff["references"]
    assert all(author["family-names"] in method for author in paper["authors"])
    assert paper["identifiers"][0]["value"] in method


def test_example_designs_are_read():
    design, boxes, solid, joint, fixture = map(
        json.loads, blocks(ROOT / "docs/designs.md", "json")
    )
    plan, guarded, finding = map(json.loads, blocks(ROOT / "docs/plans.md", "json"))
    assert design["strategies"][0]["action_sets"]
    seen = Seen(
        {
            "cube": Pose.xyz_rpy((0.6, 0.0, 0.0)),
            "goal": Pose.xyz_rpy((0.6, -0.2, 0.0)),
        }
    )
    waypoints = (
        installed()
        .create("action", "anchored")
        .parse(plan, gripper=False)
        .resolve(seen)
    )
    np.testing.assert_allclose(waypoints.poses[1, :3], [0.6, 0.06, 0.12])
    for steps in (guarded, finding):
        assert (
            installed()
            .create("action", "anchored")
            .parse(steps, gripper=False)
            .steps[1]
            .until
            == "touch"
        )
    assert finding[1]["corrects"] == ["box"]
    parts = installed().create("tool", "boxes").parse(fixture["fixture"], gripper=False)
    assert parts.components
    boxes["tool_components"][1] |= joint
    component = {"name": "shell", "solid": solid, "position": [0, 0, -0.2]}
    for name, data in (("boxes", boxes), ("solids", {"tool_solids": [component]})):
        tool = (
            installed()
            .create("tool", name, {"joints": True})
            .parse(data, gripper=False)
        )
        assert len(tool.bearers) == (name == "boxes")
    assert len(tool.components[0].shape.convex_parts()) > 1


# --- writing a scene --------------------------------------------------------------------------------------------

SCENE_PAGE = ROOT / "docs/writing_a_scene.md"


def test_the_scene_of_the_page_passes_its_checks(tmp_path):
    """As the page has it: the pieces in one file, and the last piece beside it."""
    build.page_module(tmp_path)
    code = blocks(SCENE_PAGE, "python")[4]
    done = warm_python(["-c", code], tmp_path, os.environ)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) > 5
    assert all(line.endswith(": ok") for line in lines), done.stdout
    assert Image.open(tmp_path / "scene.png").size == (640, 480)


@pytest.mark.thorough
def test_the_scene_of_the_page_becomes_a_part(tmp_path):
    """The package that the page's command writes, with the page's file in it."""
    folder, module = write_package("task", "PullTray", tmp_path / "pull_tray")
    build.page_module(tmp_path)
    (tmp_path / "pull_tray.py").replace(module)
    site = install([folder], tmp_path / "site")
    for words in (
        ["core", "conformance", "task=PullTray"],
        ["core.run", "task=PullTray", *SMALL],
    ):
        done = python_m(tmp_path, *words, PYTHONPATH=str(site))
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_scene_files_of_the_page_are_tasks(tmp_path):
    whole, *small, imports, photographs = blocks(ROOT / "docs/scene_files.md", "yaml")
    *breaking, joints, _ = blocks(ROOT / "docs/scene_things.md", "yaml")
    small += breaking
    for text in small:
        (tmp_path / "small.yaml").write_text(text)
        task = installed().create("task", "file", file=str(tmp_path / "small.yaml"))
        start = task.scene(0).state()
        whole_things = dict.fromkeys(task.scene(0).breakable, np.zeros(2))
        film = Trace.of(start, start, forces={}, strains=whole_things)
        assert task.reward(start, start, film) < 0.1, task.name
    (tmp_path / "whole.yaml").write_text(whole)
    verdicts = [
        *examine(
            "task",
            installed().create("task", "file", file=str(tmp_path / "whole.yaml")),
        )
    ]
    assert verdicts
    assert [verdict.problem for verdict in verdicts if verdict.problem] == []
    bodies = "".join(
        f"  - {{name: {name}, box: [0.1, 0.1, 0.1], position: [0.5, {y}, 0.3], mass: 1}}\n"
        for name, y in (("cabinet", 0), ("drawer", 0), ("button", 0.2), ("door", -0.3))
    )
    goal = "goals:\n  - {joint: runner, to: 0.2}\n"
    text = f"name: Moving\ndescription: Each joint that the page shows, on a cube.\nbodies:\n{bodies}{joints}{goal}"
    (tmp_path / "cupboard.urdf").write_text(
        '<robot name="c"><link name="box"><collision><geometry>'
        '<box size="1 1 1"/></geometry></collision></link></robot>'
    )
    for name in ("bench.jpg", "tripod.png"):
        Image.new("RGB", (64, 48)).save(tmp_path / name)
    (tmp_path / "moving.yaml").write_text(text + imports + photographs)
    task = installed().create("task", "file", file=str(tmp_path / "moving.yaml"))
    assert [picture.name for picture in task.photographs()] == ["photo1", "photo2"]
    scene = task.scene(0)
    assert [joint.name for joint in scene.joints] == ["runner", "click", "gate"]
    assert "cupboard_box" in [body.name for body in scene.bodies]


@pytest.mark.parametrize(
    "of",
    [
        Body,
        Box,
        Camera,
        Cylinder,
        Geom,
        Reach,
        Joint,
        Bond,
        Mesh,
        Pose,
        Scene,
        Sphere,
        State,
    ],
)
def test_the_tables_have_every_field_and_its_default(of):
    page = "scene_goals" if of is Reach else "scene_types"
    text = (ROOT / f"docs/{page}.md").read_text()
    if f"## {of.__name__}\n" in text:
        section = text.partition(f"## {of.__name__}\n")[2].partition("\n## ")[0]
        rows = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|", section, re.MULTILINE))
        assert list(rows) == [field.name for field in dataclasses.fields(of)]
        for field in dataclasses.fields(of):
            if field.default is not dataclasses.MISSING:
                assert rows[field.name] == str(field.default), field.name
            elif field.default_factory is dataclasses.MISSING:
                assert rows[field.name] == "needed", field.name
    else:
        (row,) = re.findall(rf"^\| `{of.__name__}` \| (.*?) \|", text, re.MULTILINE)
        assert re.findall(r"`(\w+)`", row) == [
            field.name for field in dataclasses.fields(of)
        ]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_the_table_of_goals_has_the_fields_of_each_kind(kind):
    text = (ROOT / "docs/scene_goals.md").read_text()
    (row,) = re.findall(rf"^\| `{kind.__name__}` \| (.*) \|$", text, re.MULTILINE)
    common = {field.name for field in dataclasses.fields(Reach)}
    fields = {field.name for field in dataclasses.fields(kind)}
    assert fields - common <= set(re.findall(r"`(\w+)`", row))


@pytest.mark.thorough
def test_pictures_of_the_page_are_drawn(tmp_path):
    """Each is one that the page shows, of the size that it has there, and not blank."""
    build.scene(tmp_path)
    shown = re.findall(r"\]\((images/scene/\w+\.png)\)", SCENE_PAGE.read_text())
    assert sorted(Path(name).name for name in shown) == sorted(
        file.name for file in tmp_path.iterdir()
    )
    for name in shown:
        drawn, kept = (
            Image.open(file)
            for file in (tmp_path / Path(name).name, ROOT / "docs" / name)
        )
        assert drawn.size == kept.size
        assert len(np.unique(np.asarray(drawn))) > 50
