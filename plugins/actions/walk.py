"""Carry an anchored plan out in one layout, as far as what was seen and felt until now leads.

It is a function of what was seen and felt, and no more: it keeps nothing between two calls. So a plan is walked from
its begin each time that something new is known, and takes the same way up to there.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import DesignError
from core.designs.planning import blur
from core.geometry import Array, Pose
from core.interfaces import (
    Judge,
    Look,
    Perception,
    Seen,
    Sighted,
    Tempo,
    Waypoints,
)
from plugins.actions.blocks import (
    Choose,
    Each,
    Item,
    LookStep,
    Repeat,
    Sighting,
    condition_of,
    list_items,
    match_names,
)
from plugins.actions.steps import HERE, IT, RESERVED, UNTIMED, Step, place_anchor

FLAT_M = 0.01
"""What is thinner is a flat mark, and what stands on it up to `OVER_M` is inside."""

OVER_M = 0.1

_ANGLES = ("roll", "pitch", "yaw")
_DRAWS = 40  # of what may be where, by the noise of what is seen
_SAME_S = 1e-6  # two looks at the same instant say nothing of speed


class Walk:
    """A plan on its way: where it goes, from what is known.

    Args:
        seen: what is known.
        gripper: whether waypoints move the gripper.

    Attributes:
        steps: the waypoints so far, in the order in which the arm goes there.
        looks: those that were taken, and the one that is to be taken next.
    """

    def __init__(self, seen: Seen, gripper: bool) -> None:
        self.steps: list[Step] = []
        self.looks: list[Look] = []
        self._rows: list[list[float]] = []
        self._gripper = gripper
        self._judge = seen.judge
        self._noise = seen.noise
        self._most_s = seen.most_s
        self._felt = list(seen.felt)
        self._waiting = list(seen.looks)
        self._sightings = [Sighted(seen.poses)]
        self._known = dict(seen.poses)  # with what guards felt since the last look
        self._scope: list[str] = []
        self._it = IT
        self._since: float | None = 0.0  # seconds asked for since the last look

    def waypoints(self) -> Waypoints:
        """Return the waypoints so far.

        Raises:
            DesignError: there are none.
        """
        if not self._rows:
            raise DesignError(
                "the plan goes nowhere in this layout before its first look; begin with a waypoint"
            )

        guards = tuple(step.guard for step in self.steps)
        if not any(guards):
            guards = ()

        return Waypoints(
            np.array(self._rows), _tempo(self.steps), guards, tuple(self.looks)
        )

    def run(self, items: Sequence[Item]) -> bool:
        """Carry steps out one after another.

        Returns:
            Whether they came to their end; else there is a look whose result is not known yet.

        Raises:
            DesignError: a step needs what is not there.
        """
        return all(map(self._do, items))

    def _do(self, item: Item) -> bool:
        match item:
            case Step():
                self._go(item.bound(self._it))
                return True
            case LookStep():
                return self._look()
            case Repeat():
                return self._repeat(item)
            case Each():
                return self._do_each(item)
            case Choose():
                holds = self._holds(item.choose)
                return self.run(item.then if holds else item.otherwise)

    def _repeat(self, block: Repeat) -> bool:
        """Do a block until its condition holds."""
        for number in range(1, block.at_most + 1):
            with self._within(f"round {number}"):
                steps = block.repeat
                if isinstance(steps[0], LookStep):
                    steps = steps[1:]
                    if not self._look():
                        return False

                if self._holds(block.until_seen):
                    return True
                if not self.run(steps):
                    return False

        return True

    def _do_each(self, block: Each) -> bool:
        """Do a block for each body that is not yet where it should be, the nearest first."""
        done: list[str] = []

        while len(done) < block.at_most:
            left = self._list_left(block)
            waiting = [name for name in left if name not in done]
            if not waiting:
                return True

            name = min(waiting, key=self._measure_way)
            done.append(name)
            with self._within(name):
                outer = self._it
                self._it = name
                if not self.run(block.do):
                    return False

                self._it = outer

        return True

    @contextmanager
    def _within(self, name: str) -> Iterator[None]:
        """Say where in the plan what follows is."""
        self._scope.append(name)
        yield
        self._scope.pop()

    @property
    def _where(self) -> str:
        return ", ".join(self._scope)

    def _look(self) -> bool:
        """Look again; before the first waypoint it is what is seen before the motion.

        Returns:
            Whether it is known what is seen.
        """
        if not self._rows and not self.looks:
            return True

        self.looks.append(Look(len(self._rows), self._where))
        if not self._waiting:
            return False

        seen = self._waiting.pop(0)
        self._sightings.append(seen)
        here = self._known.get(HERE)
        self._known = dict(seen.poses)
        self._since = 0.0
        if here is not None:
            self._known[HERE] = here

        return True

    def _go(self, step: Step) -> None:
        """Go to a waypoint: what a guard felt moves those that follow."""
        where = f"waypoint {len(self._rows) + 1}"
        if self._scope:
            where += f" ({self._where})"

        known = Seen(self._known)
        if step.meet:
            known = Seen({**self._known, step.anchor: self._foresee(step, where)})

        pose = step.frame(known, where) @ Pose.xyz_rpy(step.offset, step.rpy)
        if step.until:
            self._feel(step, pose, where)

        row = [*pose.position, *pose.rpy]
        if self._gripper:
            row.append(step.grip)

        self._rows.append(row)
        self.steps.append(step)
        if self._since is not None:
            spent = self._since + step.seconds + step.wait
            self._since = spent if step.is_timed else None

    def _feel(self, step: Step, pose: Pose, where: str) -> None:
        """Take what a guard felt; where that is not known yet, it ends at its waypoint."""
        reached = self._felt.pop(0) if self._felt else None
        here = reached or pose

        if step.corrects and not self._rows:
            raise DesignError(
                f"{where}: 'corrects' needs a waypoint before, from which the way leads there"
            )

        if step.corrects:
            way = pose.position - self._rows[-1][:3]
            missed = here.position - pose.position
            corrected = step.corrected(
                Seen({**self._known, HERE: here}), way, missed, where
            )
            if reached:
                self._known |= corrected

        self._known[HERE] = here

    def _foresee(self, step: Step, where: str) -> Pose:
        """Return where the anchor of a waypoint will be when that is reached, if it moves on as two looks saw it move.

        Raises:
            DesignError: it was not seen twice, or it is not known when the waypoint is reached.
        """
        name = step.anchor
        taken = [s for s in self._sightings if name not in s.taken_s]
        if len(taken) < 2 or taken[-1].at_s - taken[-2].at_s < _SAME_S:
            raise DesignError(
                f"{where}: 'meet' needs {name} to be seen twice, the second time by a look"
            )

        if self._since is None:
            raise DesignError(f"{where}: {UNTIMED}")

        before, last = (place_anchor(name, Seen(s.poses), where) for s in taken[-2:])
        velocity = (last.position - before.position) / (taken[-1].at_s - taken[-2].at_s)
        met_s = self._sightings[-1].known_s + self._since + step.seconds
        way = velocity * (met_s - taken[-1].at_s)

        return Pose(last.position + way, last.quaternion)

    def _holds(self, wanted: Sighting) -> bool:
        """Report whether a condition holds, as the scene was seen last, with the probability that it asks for."""
        if wanted.left_s is not None:
            return self._most_s - self._sightings[-1].known_s <= wanted.left_s

        answers = self._sightings[-1].answers
        asked = wanted, self._it
        if asked not in answers:
            seen = list(self._list_possible(wanted))
            held = sum(self._holds_in(wanted, poses) for poses in seen)
            answers[asked] = held >= _count_needed(wanted, seen)
        return bool(answers[asked])

    def _list_possible(self, wanted: Sighting) -> Iterator[Mapping[str, Pose]]:
        """Yield what was seen; where a condition asks how sure it is, what else it may be by its noise."""
        taken = self._sightings[-wanted.mean_of :]
        mean = _average_poses([sighted.poses for sighted in taken])
        if not wanted.sure or not any(self._noise):
            yield mean
            return

        sight = Perception(*(np.array(self._noise) / math.sqrt(len(taken))).tolist())
        for draw in range(1, _DRAWS + 1):
            yield blur(mean, len(self._sightings), sight, draw)

    def _holds_in(self, wanted: Sighting, poses: Mapping[str, Pose]) -> bool:
        """Report whether a condition about what is seen holds where bodies are there."""
        if wanted.goal is not None:
            return not _ask(self._judge).left(wanted.goal, poses)

        body = self._it if wanted.body == IT else wanted.body
        names = match_names(body, list(poses))
        good = self._list_right(wanted, names, poses)
        return len(good) >= (wanted.enough or len(names))

    def _has_slowed(self, name: str, place: Array, most: float) -> bool:
        """Report whether a body moved more slowly than ``most`` from the look before to this place."""
        *_, before, last = [None, *self._sightings]
        if before is None or last.at_s - before.at_s < _SAME_S:
            return False
        way = math.dist(place, before.poses[name].position)
        return way < most * (last.at_s - before.at_s)

    def _is_right(self, wanted: Sighting, name: str, poses: Mapping[str, Pose]) -> bool:
        """Report whether a body is where a condition wants it."""
        place = poses[name].position
        if wanted.above is not None:
            return bool(place[2] > wanted.above)
        if wanted.slower is not None:
            return self._has_slowed(name, place, wanted.slower)
        if wanted.between is not None:
            least, most = wanted.between
            turned = poses[name].rpy[_ANGLES.index(wanted.angle)]
            return bool((turned - least) % math.tau <= most - least)

        to = wanted.at or wanted.inside
        anchor = place_anchor(self._it if to == IT else to, Seen(poses), "a condition")
        if wanted.at:
            assert wanted.within is not None
            return math.dist(place, anchor.position) <= wanted.within

        middle, half = _ask(self._judge).box(to)
        beside = anchor.inverse().apply(place) - middle
        top = half[2] if half[2] > FLAT_M / 2 else OVER_M
        inside = np.abs(beside[:2]) <= half[:2]
        return bool(inside.all() and -half[2] <= beside[2] <= top)

    def _list_left(self, block: Each) -> Sequence[str]:
        """List the bodies of a pattern that are not yet where they should be."""
        wanted = block.until_seen
        answers = self._sightings[-1].answers
        asked = block.each, wanted, self._it
        if asked not in answers:
            seen = list(self._list_possible(wanted))
            names = match_names(block.each, list(seen[0]))
            right: Counter[str] = Counter()
            for poses in seen:
                right.update(self._list_right(wanted, names, poses))
            needed = _count_needed(wanted, seen)
            answers[asked] = [name for name in names if right[name] < needed]
        left: Sequence[str] = answers[asked]
        return left

    def _list_right(
        self, wanted: Sighting, names: Sequence[str], poses: Mapping[str, Pose]
    ) -> list[str]:
        """List the bodies that are where a condition wants them."""
        if wanted.goal is not None:
            left = _ask(self._judge).left(wanted.goal, poses)
            return [name for name in names if name not in left]

        return [name for name in names if self._is_right(wanted, name, poses)]

    def _measure_way(self, name: str) -> float:
        """Measure how far a body is from the last waypoint, seen from above, metres."""
        place: Array = np.zeros(2)
        if self._rows:
            place = np.array(self._rows[-1][:2])

        return math.dist(self._sightings[-1].poses[name].position[:2], place)


def _count_needed(wanted: Sighting, seen: Sequence[object]) -> float:
    """Count in how many of the scenes that may be there a condition has to hold."""
    return max(wanted.sure * len(seen), 1)


def _average_poses(several: Sequence[Mapping[str, Pose]]) -> Mapping[str, Pose]:
    """Compute the mean poses of bodies that were seen several times."""
    if len(several) == 1:
        return several[0]

    means = {}
    for name in several[-1]:
        poses = [poses[name] for poses in several]
        place = np.mean([pose.position for pose in poses], axis=0)
        turn = Rotation.concatenate([pose.rotation for pose in poses]).mean()
        means[name] = Pose.from_rotation(place, turn)
    return means


def _ask(judge: Judge | None) -> Judge:
    """Return what judges what is seen.

    Raises:
        DesignError: nothing does.
    """
    if judge is None:
        raise DesignError("nothing here says what the goals are; name bodies")
    return judge


def _tempo(steps: Sequence[Step]) -> Tempo | None:
    """Return what waypoints say of time; None: nothing."""
    if not any(
        step.speed or step.seconds or step.through or step.wait for step in steps
    ):
        return None

    return Tempo(
        np.array([step.seconds or math.nan for step in steps]),
        np.array([step.speed or math.nan for step in steps]),
        np.array([step.through for step in steps]),
        np.array([step.wait for step in steps]),
    )


def check_names(items: Sequence[Item], seen: Seen) -> None:
    """Refuse a plan with blocks that names what is not there, also in steps that may never be carried out.

    Raises:
        DesignError: names it, and what is possible.
    """
    for item in list_items(items):
        if isinstance(item, Step):
            for name in item.names:
                _check_name(name, seen)
        elif not isinstance(item, LookStep):
            _check_sighting(condition_of(item), seen)

        if isinstance(item, Each):
            _check_pattern(item.each, seen)
            if item.until_seen.goal is not None:
                _check_wanted(item, _ask(seen.judge))


def _check_name(name: str, seen: Seen) -> None:
    if name.lower() not in RESERVED:
        place_anchor(name, seen, "the plan")


def _check_pattern(pattern: str, seen: Seen) -> None:
    if pattern != IT and not match_names(pattern, list(seen.poses)):
        raise DesignError(
            f"the plan: no body {pattern!r}; possible: {', '.join(seen.poses)}"
        )


def _check_sighting(wanted: Sighting, seen: Seen) -> None:
    """Refuse a condition about what is not there."""
    if wanted.left_s is not None:
        return
    if wanted.goal is not None:
        _ask(seen.judge).names(wanted.goal)
        return

    _check_pattern(wanted.body, seen)
    count = len(match_names(wanted.body, list(seen.poses)))
    if wanted.body != IT and wanted.enough > count:
        raise DesignError(
            f"the plan: 'enough' is {wanted.enough}, and of {wanted.body!r} there are {count}"
        )

    for name in wanted.names:
        _check_name(name, seen)


def _check_wanted(block: Each, judge: Judge) -> None:
    """Refuse a block for bodies that the goal is not about."""
    assert block.until_seen.goal is not None
    names = judge.names(block.until_seen.goal)
    if not match_names(block.each, names):
        raise DesignError(
            f"the plan: goal {block.until_seen.goal} is not about {block.each!r}, but about: {', '.join(names)}"
        )
