"""An adapter of an engine that ignores something of a job is caught."""

from dataclasses import replace

import numpy as np
import pytest

from core.interfaces import Ability, Block, Passed, World
from core.simulation.engines import SteppingSimulator
from plugins.conformance.impacts import check_forces_are_those_that_press
from plugins.conformance.playing import (
    check_fast_ways_are_what_steps_give,
    check_motors_bear_what_statics_says,
    check_scene_of_the_job_is_played,
    check_that_touch_ends_at_a_wall,
)
from plugins.conformance.shared import LeftOut


class Follows(World):
    """The arm is where its targets are, and bodies stay where they are put."""

    time_step = 0.01

    def __init__(self, start, job):
        self.start = start
        self.arm = job.trajectory.arm[0]

    def step(self, order):
        self.arm = np.array(order.arm)

    def joints(self):
        return self.arm, np.zeros(2)

    def state(self):
        return self.start


class Engine(SteppingSimulator):
    """Builds a world of a class for each job."""

    world_class = Follows

    def build(self, robot, scene, job):
        return self.world_class(scene.state(), job)

    def render(self, task, **view):
        raise NotImplementedError


def engine(world, *abilities):
    class Made(Engine):
        world_class = world
        supports = frozenset(abilities)

    return Made()


def test_one_that_ignores_nothing_passes():
    check_scene_of_the_job_is_played(engine(Follows))
    check_fast_ways_are_what_steps_give(engine(Follows))


def test_one_that_plays_the_tasks_layout_instead_of_the_jobs_scene():
    class Deaf(Engine):
        def rollout(self, task, jobs):
            return super().rollout(task, [replace(job, scene=None) for job in jobs])

    with pytest.raises(AssertionError, match="where the cube of the job's scene is"):
        check_scene_of_the_job_is_played(Deaf())


class Hasty(Follows):
    """Takes the last step of a block only."""

    def advance(self, block: Block) -> Passed:
        *_, last = block.orders
        self.step(last)
        return Passed([self.note() for _ in block.marks])


def test_one_whose_fast_way_leaves_steps_out():
    with pytest.raises(AssertionError, match="joints, played and stepped"):
        check_fast_ways_are_what_steps_give(engine(Hasty))


class Weak(Follows):
    tells_torques = True

    def note_torques(self):
        return np.ones(7)


def test_one_whose_torques_are_not_those_of_statics():
    with pytest.raises(AssertionError, match="torques of the arm's motors"):
        check_motors_bear_what_statics_says(engine(Weak, Ability.TORQUES))
    with pytest.raises(AssertionError, match="which its class does not list"):
        check_motors_bear_what_statics_says(engine(Weak))
    with pytest.raises(AssertionError, match="and gave none"):
        check_motors_bear_what_statics_says(engine(Follows, Ability.TORQUES))
    with pytest.raises(LeftOut):
        check_motors_bear_what_statics_says(engine(Follows))


def test_what_is_not_listed_is_left_out_and_what_is_listed_must_be_there():
    for check in (check_forces_are_those_that_press, check_that_touch_ends_at_a_wall):
        with pytest.raises(LeftOut, match="Made does not support"):
            check(engine(Follows))

    with pytest.raises(NotImplementedError, match="forces of contacts"):
        check_forces_are_those_that_press(engine(Follows, Ability.FORCES))
    with pytest.raises(NotImplementedError, match="what pushes the arm"):
        check_that_touch_ends_at_a_wall(engine(Follows, Ability.GUARDS))
