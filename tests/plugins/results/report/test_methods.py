"""Methods are named by the settings that distinguish them; runs are grouped by them."""

from pathlib import Path

from plugins.results.pages.runs import LeftOutRun, find_runs
from plugins.results.report.methods import group, label
from tests.core.run_folders import write_run


def config(**choices):
    base = {
        "task": {"name": "BringCube", "tool_kinds": ["rigid"], "paper": {"k_top": 5}},
        "sim": {"name": "pybullet", "time_step": 0.002},
        "vlm": {"name": "offline"},
        "tool": {"name": "urdf"},
        "evolution": {"name": "vlmgineer"},
        "prompt": {"name": "vlmgineer"},
        "budget": {"name": "quick", "n_agent": 4, "k_top": 5},
        "executor": {"name": "local", "workers": None},
        "listener": {"progress": {}},
        "seed": 0,
        "film": True,
    }
    for path, value in choices.items():
        group, _, key = path.partition("__")
        if key:
            base[group] = base[group] | {key: value}
        else:
            base[group] = {"name": value} if isinstance(value, str) else value
    return base


def labels(*configs, tasks=None):
    names = tasks or ["BringCube"] * len(configs)
    runs = [
        LeftOutRun(Path(), "failed", "", task, given)
        for task, given in zip(names, configs, strict=True)
    ]
    return list(label(runs).values())


def test_methods_are_named_by_the_choices_that_differ():
    assert labels(
        config(),
        config(evolution="sampling"),
        config(tool="none"),
        config(tool="rlbench"),
    ) == [
        "tool=urdf evolution=vlmgineer",
        "tool=urdf evolution=sampling",
        "tool=none evolution=vlmgineer",
        "tool=rlbench evolution=vlmgineer",
    ]
    assert labels(config(), config(sim="sapien")) == ["sim=pybullet", "sim=sapien"]
    assert labels(config(), config(fitness="robust")) == [
        "no fitness",
        "fitness=robust",
    ]


def test_what_follows_the_seed_of_the_run_is_no_difference():
    restless = [
        config(seed=seed, evolution="Restless", evolution__seed=seed)
        | {"name": "restless"}
        for seed in range(3)
    ]
    assert labels(*restless) == ["restless"] * 3
    drawn_once = config(seed=1, evolution="Restless", evolution__seed=0)
    assert (
        labels(*restless, drawn_once | {"name": "restless"})
        == ["restless (differing in evolution.seed)"] * 4
    )


def test_a_method_is_called_as_the_user_says():
    ours = config(sim="sapien") | {"name": "ours"}
    assert labels(
        config(), ours, config() | {"name": ""}, config(evolution="sampling"), ours
    ) == [
        *(
            "evolution=vlmgineer",
            "ours",
            "evolution=vlmgineer",
            "evolution=sampling",
            "ours",
        )
    ]
    # Whatever else differs, which is said.
    assert (
        labels(ours, config(seed=1) | {"name": "ours"})
        == ["ours (differing in sim)"] * 2
    )
    assert labels(config() | {"name": ["no name"]}) == [
        "tool=urdf evolution=vlmgineer vlm=offline"
    ]


def test_a_setting_makes_a_method_where_the_choices_are_the_same():
    assert labels(config(), config(budget__n_agent=8)) == [
        "budget.n_agent=4",
        "budget.n_agent=8",
    ]
    assert labels(config(), config(task__tool_kinds=["gripper"])) == [
        'task.tool_kinds=["rigid"]',
        'task.tool_kinds=["gripper"]',
    ]


def test_options_of_a_model_make_a_method_where_other_runs_have_none():
    given = config(vlm={"name": "litellm", "options": {"top_p": 0.9}})
    assert labels(config(vlm={"name": "litellm", "options": None}), given) == [
        "no vlm.options.top_p",
        "vlm.options.top_p=0.9",
    ]


def test_what_follows_from_a_choice_or_from_the_task_makes_none():
    quick = config()
    paper = config(budget={"name": "paper", "n_agent": 20, "k_top": 5})
    other = config(
        budget={"name": "paper", "n_agent": 20, "k_top": 7}, task__paper={"k_top": 7}
    )
    assert labels(quick, paper, other, tasks=["BringCube", "BringCube", "LiftBox"]) == [
        "budget=quick",
        "budget=paper",
        "budget=paper",
    ]


def test_a_setting_of_its_own_makes_a_method_in_another_task_too():
    """Averages over tasks are of runs with one budget."""
    small = config(budget__n_agent=1)
    assert labels(config(), small, tasks=["BringCube", "ScoreGoal"]) == [
        "budget.n_agent=4",
        "budget.n_agent=1",
    ]


def test_runs_are_grouped_and_left_out_ones_counted(tmp_path):
    for seed in (0, 1):
        write_run(tmp_path / f"ours{seed}", f"seed={seed}", rewards=[[0.5 + seed / 4]])
    write_run(tmp_path / "ours2", "seed=2", rewards=[[0.9]], finish=False)
    write_run(tmp_path / "ours3", "seed=3", rewards=[[None]])
    write_run(tmp_path / "sampled", "evolution=sampling", rewards=[[0.4]])
    write_run(tmp_path / "book", "task=OneBook", rewards=[[0.3]])
    groups = group(*find_runs([tmp_path]))
    assert [(g.task, g.method, g.rewards, g.left_out) for g in groups] == [
        ("BringCube", "evolution=vlmgineer", [0.5, 0.75], 2),
        ("BringCube", "evolution=sampling", [0.4], 0),
        ("OneBook", "evolution=vlmgineer", [0.3], 0),
    ]
