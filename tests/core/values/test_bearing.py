"""Who bears whom, in traces made by hand: each question from both sides."""

import numpy as np
import pytest

from core.geometry import Pose
from core.scene import Body, Bond, Box, Elastic, Filling, Joint, Scene, Soft, Trace
from core.values.bearing import ROBOT, WORLD

RED = (1.0, 0.0, 0.0, 1.0)
CUBE = Box((0.1, 0.1, 0.1))
YES = np.array([True])
NO = np.array([False])


def body(name, mass=1.0):
    return Body.of(name, CUBE, (0.5, 0, 0), mass=mass, color=RED)


def rope(*pinned):
    form = Filling(CUBE, (2, 2, 2))
    elastic = Elastic(150, 20000)
    return Soft.make("pad", form, elastic, Pose(), color=RED, pinned=pinned)


BODIES = (body("table", 0), body("cup"), body("lid"), body("bow"))
BOW = Joint("pin", "hinge", "bow", "cup")
GLUE = Bond("glue", "lid", 5.0, "cup")


def support(touching, *links, bodies=BODIES, forces=None, strain=0.2):
    """One instant: which pairs touch (``tool rod cup``), and what joins them."""
    joints = tuple(link for link in links if isinstance(link, Joint))
    bonds = tuple(link for link in links if isinstance(link, Bond))
    scene = Scene(bodies, joints, bonds=bonds)
    trace = Trace.of(
        scene.state(),
        touching={tuple(pair.split()): YES for pair in touching},
        forces=forces,
        strains={bond.name: np.array([strain]) for bond in bonds},
    )
    return trace.support


TO_TABLE = Joint("rail", "slider", "cup", "table")
TO_WORLD = Joint("rail", "slider", "cup")
ON_BRANCH = Bond("stem", "cup", 5.0, "table")


@pytest.mark.parametrize(
    ("touching", "links", "held", "linked"),
    [
        ([], (), False, False),
        (["tool rod cup"], (), True, True),
        (["tool rod cup", "body cup table"], (), False, True),
        # by its bow, its lid, or both
        (["tool rod bow"], (), False, False),
        (["tool rod bow"], (BOW,), True, True),
        (["tool rod bow", "body cup table"], (BOW,), False, True),
        (["tool rod lid"], (GLUE,), True, True),
        (["tool rod lid", "body bow table"], (GLUE, BOW), False, True),
        # an apple on its branch, a drawer, a cart on rails
        (["tool rod cup"], (ON_BRANCH,), False, True),
        (["tool rod cup"], (TO_TABLE,), False, True),
        (["tool rod cup"], (TO_WORLD,), False, True),
        (["arm hand lid", "body lid cup"], (TO_WORLD,), False, True),
    ],
)
def test_what_the_robot_holds_and_reaches(touching, links, held, linked):
    found = support(touching, *links)
    assert found.held("cup").tolist() == [held]
    assert found.linked("cup").tolist() == [linked]


def test_a_broken_bond_holds_nothing():
    assert support(["tool rod lid"], GLUE, strain=1.0).linked("cup").all()
    assert not support(["tool rod lid"], GLUE, strain=1.001).linked("cup").any()
    assert support(["tool rod cup"], ON_BRANCH, strain=1.001).held("cup").all()
    assert support([], ON_BRANCH).hangs("cup").all()
    assert not support([], ON_BRANCH, strain=1.001).hangs("cup").any()


def test_a_pinned_cloth_bears_what_lies_in_it():
    lies = ["arm hand cup", "body cup pad"]
    loose = support(lies, bodies=(*BODIES, rope()), forces={})
    pinned = support(lies, bodies=(*BODIES, rope(0)), forces={})
    assert loose.held("cup").all()
    assert not pinned.held("cup").any()
    assert pinned.hangs("pad").all()
    assert not pinned.hangs("cup").any()  # it may be lifted out


@pytest.mark.parametrize(
    ("forces", "stands"),
    [
        ({}, False),
        ({("cup", "table"): 2.0}, True),
        ({("table", "cup"): 2.0, ("lid", "cup"): 0.5}, True),  # a lid on it, a wall
        ({("table", "cup"): 0.5, ("lid", "cup"): 2.0}, False),  # it leans on the table
        ({("table", "cup"): 2.0, ("tool", "cup"): 3.0}, False),
        ({("table", "lid"): 2.0, ("lid", "cup"): 1.0}, False),
    ],
)
def test_a_body_stands_on_what_bears_most_of_it(forces, stands):
    measured = {pair: np.array([force]) for pair, force in forces.items()}
    assert support([], forces=measured).stands("cup", "table").tolist() == [stands]


def pressed(links, answer, strain=0.0, first=0.0):
    """Press the cup through what is linked to it, with 10 N on bow and lid each; the table answers with a force."""
    scene = Scene(
        BODIES,
        tuple(link for link in links if isinstance(link, Joint)),
        bonds=tuple(link for link in links if isinstance(link, Bond)),
    )
    trace = Trace.of(
        *[scene.state()] * 2,
        forces={
            ("tool", "bow"): np.array([0.0, 10.0]),
            ("tool", "lid"): np.array([0.0, 10.0]),
            ("table", "cup"): np.array([first, answer]),
        },
        strains={"glue": np.array([0.0, strain])},
    )
    return float(trace.force_n("cup", "robot"))


@pytest.mark.parametrize(
    ("links", "given", "force"),
    [
        ((), {"answer": 9.0}, 0.0),
        ((BOW,), {"answer": 9.0}, 9.0),
        ((BOW,), {"answer": 30.0}, 10.0),
        ((BOW,), {"answer": 0.0, "first": 2.0}, 2.0),  # lifted: its weight
        ((BOW,), {"answer": 0.0}, 0.0),  # two fingers pinch the bow
        ((GLUE,), {"answer": 9.0, "strain": 0.8}, 4.0),
        ((GLUE, BOW), {"answer": 9.0, "strain": 0.8}, 14.0),  # the lid answers, too
    ],
)
def test_what_joints_and_bonds_pass_on(links, given, force):
    assert pressed(links, **given) == pytest.approx(force)


def test_a_joint_to_what_is_fixed_answers_whatever_comes():
    rail = Joint("rail", "slider", "cup", "table")
    assert pressed((BOW, rail), answer=0.0) == 10.0


def test_words_say_what_bears_what():
    hung = support(
        ["tool hook bow"],
        BOW,
        ON_BRANCH,
        forces={("tool", "bow"): np.array([2.34])},
    )
    way = "bow is joined by pin to cup, bow touches hook"
    assert hung.say("cup", ROBOT) == way
    assert hung.say("cup", WORLD) == "cup is bonded by stem to table (1 N)"
    assert hung.say("lid", ROBOT) == ""
    with pytest.raises(KeyError, match="no body 'dog'"):
        hung.held("dog")
