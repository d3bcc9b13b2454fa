"""Conditions, trials, and what an evaluation says of them."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import Condition, Evaluation, Observation, Score, Trial
from core.plugins import PluginPart
from core.trial import Where, best_first, best_tools, count_rollouts
from core.values.margins import Margin
from core.values.plans import Waypoints
from plugins.conformance.evaluations import tried_once
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation
from plugins.multitask.joined_plans import TaskPlans

ROD = Tool((Component("rod", "tool_mount", Pose(), Box((0.1, 0.1, 0.1)), mass=0.25),))
PLAN = Waypoints(np.zeros((1, 6)))
CANDIDATE = Candidate(ROD, PLAN)


def trial(layout=0, reward=0.0, engine="mujoco", task="Slide", **given):
    return Trial(Where(task, engine, layout), CANDIDATE.id, reward=reward, **given)


def tried(*trials, shown=0, reward=0.5, **score):
    return Evaluation(CANDIDATE, trials, Score(reward, shown=shown, **score))


# --- an evaluation ----------------------------------------------------------------------------------------------


def test_an_evaluation_says_what_the_trial_that_is_shown_says():
    seen = Observation("missed")
    shown = trial(
        1, 0.25, reason="it passed through", warnings=("it bent",), observation=seen
    )
    evaluation = tried(
        trial(0, 1.0),
        shown,
        shown=1,
        warnings=("it failed elsewhere",),
        figures={"lean": 0.1},
    )
    assert evaluation.shown is shown
    assert (evaluation.status, evaluation.reason, evaluation.reward) == (
        "ok",
        "it passed through",
        0.5,
    )
    assert evaluation.warnings == ("it bent", "it failed elsewhere")
    assert evaluation.observation is seen
    assert evaluation.figures == {"lean": 0.1}


def test_a_score_may_say_why_it_is_less_than_the_trials_earned():
    evaluation = tried(
        trial(0, 1.0, reason="it passed through"),
        reward=0.0,
        reason="no printer makes it",
    )
    assert evaluation.reason == "no printer makes it"


def test_without_trials_it_is_rejected_for_the_candidates_problem():
    refused = Evaluation(replace(CANDIDATE, problem="it is too heavy"))
    assert (refused.status, refused.reason, refused.reward) == (
        "rejected",
        "it is too heavy",
        0.0,
    )
    assert (refused.shown, refused.observation, refused.warnings, refused.effort) == (
        None,
        None,
        (),
        None,
    )
    assert (refused.least_margin, refused.tasks, refused.rollouts) == (None, (), 0)
    assert math.isnan(refused.distance_m)


def test_the_distance_is_the_mean_over_the_trials_that_were_played():
    ways = {number: {"distance_m": float(number)} for number in (1, 2, 9)}
    rejected = trial(2, status="rejected", measured=ways[9])
    played = trial(0, measured=ways[1]), trial(1, measured=ways[2])
    assert tried(*played, rejected).distance_m == 1.5
    assert math.isnan(tried(rejected).distance_m)


def test_the_least_margin_is_that_of_all_trials():
    near, far = Margin.clearance("vase", 0.004), Margin.clearance("cup", 0.04)
    assert (
        tried(trial(0, margins=(far,)), trial(1, margins=(near, far))).least_margin
        == near
    )


def with_room(number, share, reward=1.0, distance_m=1.0, **given):
    margin = Margin("offset", 1 - share, 1.0, "m", share)
    made = trial(
        0,
        reward,
        margins=(margin,),
        measured={"distance_m": distance_m},
        **({"solved": reward == 1} | given),
    )
    candidate = replace(CANDIDATE, agent=number)
    return Evaluation(candidate, (made,), Score(reward))


def test_one_order_says_reward_then_solved_then_room_then_way():
    short, roomy = with_room(0, 0.02, distance_m=0.883), with_room(1, 0.27)
    rest = [
        with_room(2, 0.262, distance_m=0.5),  # no less room that counts, and shorter
        with_room(3, 1.0, solved=False),
        with_room(4, 1.0, reward=0.9),
    ]
    assert best_first([short, *rest, roomy]) == [rest[0], roomy, short, *rest[1:]]


def test_of_those_that_earn_nothing_what_missed_by_less_goes_first_and_cheats_last():
    cheat = with_room(0, 0.9, 0.0, reason="it passed through")
    far, near = with_room(1, -0.8, 0.0), with_room(2, -0.3, 0.0)
    assert best_first([cheat, far, near]) == [near, far, cheat]


def test_a_figure_that_the_user_names_decides_in_place_of_room_and_way():
    short, roomy = with_room(0, 0.1, distance_m=0.5), with_room(1, 0.9)
    named = [
        replace(design, score=replace(design.score, cost=design.distance_m))
        for design in (short, roomy)
    ]
    assert best_first([short, roomy]) == [roomy, short]
    assert best_first(named) == named


def test_several_trials_are_combined():
    one, two = tried(trial()), tried(trial(0), trial(1))
    assert (one.combined, two.combined) == (False, True)


def test_rewards_are_told_apart_by_engine():
    good = [trial(0, 1.0, "mujoco"), trial(0, 0.95, "sapien")]
    evaluation = tried(*good, trial(1, 0.9, "sapien"))
    assert evaluation.by_engine == {"mujoco": (1.0,), "sapien": (0.95, 0.9)}


def test_the_effort_is_the_mean_over_the_trials_that_came_to_their_end():
    margins = [
        (Margin.at_most("x", value, 1, "m"), Margin.at_most("y", 0.1, 1, "m"))
        for value in (0.5, 1.4)
    ]
    ended = [
        trial(0, measured={"motion_s": 3.0}, margins=margins[0]),
        trial(1, measured={"motion_s": 5.0}, margins=margins[1]),
    ]
    effort = tried(*ended, trial(2, status="failed")).effort
    assert (effort.motion_s, effort.mass_kg) == (4.0, pytest.approx(ROD.mass))
    assert effort.margin == 0.25  # beyond the limit is no better than at it
    assert tried(trial(measured={"motion_s": 3.0})).effort.margin is None
    assert tried(trial(status="failed")).effort is None
    assert Evaluation(Candidate(None, PLAN), tuple(ended)).effort is None


@pytest.mark.parametrize(
    ("trials", "count"),
    [
        ([], 0),
        ([trial(status="rejected")], 0),
        ([trial(status="failed")], 1),
        ([trial(0), trial(1), trial(0, engine="sapien")], 3),
        ([trial(0), trial(1, status="rejected")], 1),
        (
            [trial(0), replace(trial(1), candidate="g0-a3-s0-p0")],
            1,
        ),  # another candidate's, with the same plan
    ],
)
def test_the_rollouts_of_a_candidate_are_those_that_were_played_for_it(trials, count):
    assert count_rollouts(CANDIDATE.id, trials) == tried(*trials).rollouts == count


# --- several tasks ----------------------------------------------------------------------------------------------


def test_what_was_earned_in_one_of_several_tasks():
    push, lift = Waypoints(np.zeros((1, 6))), Waypoints(np.ones((1, 6)))
    both = Candidate(ROD, TaskPlans((("Push", push), ("Lift", lift))))
    trials = (
        trial(0, 0.9, task="Push"),
        trial(0, 0.2, task="Lift", status="failed"),
        trial(1, 0.6, task="Lift"),
        trial(2, 0.4, task="Lift"),
    )
    evaluation = Evaluation(
        both, trials, Score(0.65, {"Push": 0.9, "Lift": 0.4}, shown=3)
    )
    assert evaluation.tasks == ("Push", "Lift")

    lifted = evaluation.in_task("Lift")
    assert (lifted.reward, lifted.trials, lifted.shown) == (0.4, trials[1:], trials[3])
    assert lifted.candidate.plan is lift
    assert evaluation.in_task("Push").status == "ok"


def test_of_one_task_alone_an_evaluation_is_its_own():
    evaluation = tried(trial(0, 0.9))
    alone = evaluation.in_task("Slide")
    assert (alone.candidate, alone.trials, alone.score) == (
        CANDIDATE,
        evaluation.trials,
        evaluation.score,
    )


# --- one trial, or many -----------------------------------------------------------------------------------------


def test_a_candidate_that_was_tried_once():
    evaluation = tried_once(CANDIDATE, "failed", 0.25, 3.0, reason="it broke")
    (only,) = evaluation.trials
    assert (only.candidate, only.reward, only.distance_m) == (CANDIDATE.id, 0.25, 3.0)
    assert (evaluation.status, evaluation.reason) == ("failed", "it broke")
    nearly = tried_once(CANDIDATE, "ok", 4e-4, reason="missed")  # shown as 0.000
    assert nearly.why_nothing == "missed"
    where = Where("Slide", "sapien", 3, 1)
    assert tried_once(CANDIDATE, where=where).shown.where == where


def test_the_best_tools_are_the_first_of_each():
    numbers = ((1, 4), (1, 0), (0, 2))
    ranking = [
        tried_once(Candidate(ROD, PLAN, 0, 0, strategy, action))
        for strategy, action in numbers
    ]
    assert best_tools(ranking) == [ranking[0], ranking[2]]


# --- a condition ------------------------------------------------------------------------------------------------


def made(layout=0, **given):
    return Condition(
        PluginPart("task", "BringCube"), PluginPart("sim", "mujoco"), layout, **given
    )


def test_a_condition_travels_to_workers_and_is_known_there():
    for condition in (
        made(),
        made(3, change=Perturbation(PerturbationRange(), 1), engine="mujoco (coarse)"),
    ):
        again = pickle.loads(pickle.dumps(condition))
        assert again == condition
        assert hash(again) == hash(condition)
        assert again.where == condition.where
    assert (
        len(
            {made(), made(), made(1), made(change=Perturbation(PerturbationRange(), 1))}
        )
        == 3
    )


def test_a_condition_names_where_a_trial_is():
    assert made(3).where == Where("BringCube", "mujoco", 3)
    changed = made(3, change=Perturbation(PerturbationRange(), 7), engine="mine")
    assert changed.where == Where("BringCube", "mine", 3, 7)


def test_the_scene_of_a_condition_is_the_layout_perturbed_if_asked():
    task = made().task.shared()
    plain, changed = made(3), made(3, change=Perturbation(PerturbationRange(), 7))
    layout = task.scene(3)
    assert [body.mass for body in plain.scene().bodies] == [
        body.mass for body in layout.bodies
    ]
    masses = [body.mass for body in changed.scene().bodies]
    assert masses != [body.mass for body in layout.bodies]
    assert masses == [body.mass for body in changed.scene().bodies]
