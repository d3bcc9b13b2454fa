"""The rules of the house: what may import what, where files lie, how long functions are, and where their tests are."""

import ast
import graphlib
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from core.hooks import Configs, Events, Parts
from core.plugins import KINDS, installed
from docs.diagrams import FLOORS, PARTS
from plugins.commands import commands

ROOT = Path(__file__).parents[1]
LEVEL = {
    name: height
    for height, name in enumerate(name for names in FLOORS.values() for name in names)
}
LONGEST_FUNCTION = 75  # lines of at most 88 columns, its docstring too
MOST_PARAMETERS = 8  # without self
KERNELS = "plugins.simulators.mujoco.batched.kernels"  # in Warp's language, which has no objects
ROBOTS = re.compile(  # names of arms and of their makers
    r"panda|franka|xarm|ufactory|kinova|jaco(?!bian)|unitree|universal.robots|(?<![a-z0-9])(ur\d+e?|z1|fr3)(?![a-z0-9])",
    re.IGNORECASE,
)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]
NAME = PROJECT["name"]
# Modules and packages, each of which is a plugin.
OFFERED = set(PROJECT["entry-points"]["vlmgineer"].values())
COMMANDS = {
    ".".join(re.split("[.:]", str(command.main))[:2]) for command in commands().values()
}


@cache
def modules(folder):
    files = sorted((ROOT / folder).rglob("*.py"))
    assert len(files) > 10, folder
    return [(file, ast.parse(file.read_text(encoding="utf-8"))) for file in files]


def imported(tree, runtime_only=False):
    """Full names of the modules that a file imports, inside functions too."""
    guards = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
    ]
    skipped = (
        [inner for guard in guards for node in guard.body for inner in ast.walk(node)]
        if runtime_only
        else []
    )
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield node.module
            # Some of them are modules too.
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def dotted(file):
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(
        ".__init__"
    )


def floor(module):
    """The room of ``core/``, or the file that lies in none."""
    return module.split(".")[1] if "." in module else "__init__"


def test_every_file_of_core_is_on_the_floor_plan():
    assert set(LEVEL) == {floor(dotted(file)) for file, _ in modules("core")}
    assert set(PARTS) == set(KINDS)


def imports_from_above(module, tree):
    """Return what a module of ``core/`` imports from rooms on higher floors."""
    names = [
        name
        for name in imported(tree)
        if name.startswith("core.") and floor(name) in LEVEL
    ]
    return [
        name
        for name in names
        if LEVEL[floor(name)] >= LEVEL[floor(module)] and floor(name) != floor(module)
    ]


def test_imports_go_down_only():
    """The order of rooms is the order of floors; no module is exempt."""
    found = {
        dotted(file): imports_from_above(dotted(file), tree)
        for file, tree in modules("core")
    }
    assert {module: names for module, names in found.items() if names} == {}


def test_an_import_that_goes_up_is_found():
    late = ast.parse("def search():\n    from core.search.evolution import Trials")
    assert imports_from_above("core.robot.kinematics", late) == [
        "core.search.evolution",
        "core.search.evolution.Trials",
    ]
    assert imports_from_above("core.search.designer", late) == []
    assert imports_from_above("core.run", late) == []


@pytest.mark.parametrize("folder", ["core", "plugins", "tasks"])
def test_modules_import_each_other_without_circles(folder):
    trees = {dotted(file): tree for file, tree in modules(folder)}
    graph = {
        module: {*imported(tree)} & {*trees} - {module}
        for module, tree in trees.items()
    }
    # Raises where there is a circle.
    assert len(list(graphlib.TopologicalSorter(graph).static_order())) == len(trees)


def test_the_core_knows_no_plugin_no_engine_and_no_model():
    forbidden = {
        *("plugins", "tasks", "tests"),
        *(
            "pybullet",
            "pybullet_data",
            "mujoco",
            "mujoco_warp",
            "warp",
            "genesis",
            "jax",
            "isaacsim",
            "newton",
            "sapien",
        ),
        *(
            "openai",
            "anthropic",
            "google",
            "litellm",
            "llm",
            "requests",
            "httpx",
            "torch",
        ),
    }
    for file, tree in modules("core"):
        for name in imported(tree):
            assert name.partition(".")[0] not in forbidden, f"{file} imports {name}"
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert not node.value.startswith(("plugins.", "tasks.")), (
                    f"{file} names {node.value}"
                )


def test_the_core_and_the_prompts_name_no_robot():
    for folder in ("core", "prompts"):
        files = [
            file
            for file in (ROOT / folder).rglob("*")
            if file.is_file() and file.suffix != ".pyc"
        ]
        assert len(files) > 20, folder
        for file in files:
            for number, line in enumerate(
                file.read_text(encoding="utf-8").splitlines(), 1
            ):
                assert not ROBOTS.search(line), f"{file}:{number} names a robot: {line}"
            assert not ROBOTS.search(file.name), file


@pytest.mark.parametrize(
    "line",
    [
        "panda_link7",
        "a `Franka`",
        "UR5's",
        "ur10e.urdf",
        "xArm7",
        "JACO 2",
        "z1",
        "fr3_",
    ],
)
def test_a_robots_name_is_found(line):
    assert ROBOTS.search(line)


@pytest.mark.parametrize(
    "line", ["jacobian = J(q)", "urdf", "cur5", "z10", "expand a link"]
)
def test_other_words_are_no_robots_names(line):
    assert not ROBOTS.search(line)


def test_every_robot_that_is_offered_has_a_name_that_is_looked_for():
    own = [
        offer.name
        for offer in installed().offers.values()
        if (offer.kind, offer.distribution) == ("robot", NAME)
    ]
    # One's own, from a file.
    assert [name for name in own if not ROBOTS.search(name)] == ["urdf"]


def test_plugins_do_not_know_each_other():
    for file, tree in modules("plugins"):
        parts = file.relative_to(ROOT).with_suffix("").parts
        own = ".".join(
            parts[:2] if ".".join(parts[:2]) in OFFERED | COMMANDS else parts[:3]
        )
        for name in imported(tree):
            if name.split(".")[0] in ("plugins", "tasks"):
                assert name == own or name.startswith(f"{own}."), (
                    f"{file} imports {name}"
                )


def test_tasks_are_scenes_and_numpy():
    """No engine: a task is read by people, by models and by every simulator."""
    allowed = {"core", "tasks", "numpy", "scipy", "trimesh", *sys.stdlib_module_names}
    for file, tree in modules("tasks"):
        for name in imported(tree):
            assert name.partition(".")[0] in allowed, f"{file} imports {name}"


def test_every_kind_has_a_hook_and_every_event_a_word():
    hooks = {name for name in vars(Parts) if not name.startswith("_")}
    assert {kind.hook for kind in KINDS.values()} == hooks
    for spec in (Parts, Configs, Events):
        for name, function in vars(spec).items():
            if not name.startswith("_"):
                assert function.__doc__, name


@pytest.mark.parametrize("folder", ["core", "plugins", "tasks"])
def test_no_function_is_too_long_or_takes_too_much(folder):
    """A part's ``__init__`` may have more parameters: they are the settings that a user types."""
    wrong = []
    for file, tree in modules(folder):
        for function in (
            node
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        ):
            given = function.args
            names = [
                argument.arg
                for argument in [*given.posonlyargs, *given.args, *given.kwonlyargs]
            ]
            free = dotted(file) == KERNELS or (
                folder == "plugins" and function.name == "__init__"
            )
            many = len({*names} - {"self", "cls"}) > MOST_PARAMETERS and not free
            if many or function.end_lineno - function.lineno >= LONGEST_FUNCTION:
                wrong.append(f"{dotted(file)}.{function.name}")
    assert not wrong


def test_tests_mirror_the_rooms_and_plugin_packages():
    """A test of ``core/store`` is in ``tests/core/store``; each folder of tests has its folder of code."""
    rooms = set()
    for folder in ("core", "plugins"):
        for file, _ in modules(folder):
            parent = file.relative_to(ROOT).parent
            rooms.add(Path(*parent.parts[:2]))

    tested = set()
    for folder in ("core", "plugins", "tasks"):
        for file in (ROOT / "tests" / folder).rglob("test_*.py"):
            tested.add(file.relative_to(ROOT / "tests").parent)

    assert rooms - {Path("plugins")} <= {Path(*path.parts[:2]) for path in tested}
    assert [path for path in sorted(tested) if not (ROOT / path).is_dir()] == []


def test_text_goes_to_the_terminal_one_way():
    """By `core.support.cli.say` and `core.support.cli.print_table`, which escape what is not printable."""
    for file, tree in (
        item for folder in ("core", "plugins", "tasks") for item in modules(folder)
    ):
        if dotted(file) != "core.support.cli":
            called = {
                ast.unparse(node.func)
                for node in ast.walk(tree)
                if isinstance(node, ast.Call)
            }
            assert (
                not {"print", "sys.stdout.write", "sys.stderr.write", "warnings.warn"}
                & called
            ), file
