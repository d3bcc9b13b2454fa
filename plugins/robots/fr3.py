"""The Franka Research 3, with its hand.

It has the Panda's shape, so that it is the Panda's description with other limits and inertias; links and joints keep
the Panda's names.
"""

from __future__ import annotations

from dataclasses import replace

from core.interfaces import Robot
from core.values.descriptions import Inertial
from plugins.robots.descriptions import measured, mended
from plugins.robots.panda import panda

# lower, upper, velocity, effort
LIMITS = (
    (-2.7437, 2.7437, 2.62, 87.0),
    (-1.7837, 1.7837, 2.62, 87.0),
    (-2.9007, 2.9007, 2.62, 87.0),
    (-3.0421, -0.1518, 2.62, 87.0),
    (-2.8065, 2.8065, 5.26, 12.0),
    (0.5445, 4.5169, 4.18, 12.0),
    (-3.0159, 3.0159, 5.26, 12.0),
)
INERTIALS = {
    "panda_link0": Inertial(2.3966, (-0.0172, 0.0004, 0.0745), (0.0090, 0.0, 0.0020, 0.0115, 0.0, 0.0085)),
    "panda_link1": Inertial(
        2.9274653454,
        (0.0000004128, -0.0181251324, -0.0386035970),
        (0.023927316, 1.33179e-05, -0.000114048, 0.022482161, -0.001995032, 0.006350098),
    ),
    "panda_link2": Inertial(
        2.9355370338,
        (0.0031828864, -0.0743221644, 0.0088146084),
        (0.041938946, 0.000202573, 0.004077784, 0.025145149, -0.004225216, 0.061702145),
    ),
    "panda_link3": Inertial(
        2.2449013699,
        (0.0407015686, -0.0048200565, -0.0289730823),
        (0.024101425, 0.002404695, -0.002856269, 0.019740533, -0.002104213, 0.019044494),
    ),
    "panda_link4": Inertial(
        2.6155955791,
        (-0.0459100965, 0.0630492960, -0.0085187868),
        (0.034529983, 0.013225523, 0.010151430, 0.028881622, -0.000976283, 0.041254712),
    ),
    "panda_link5": Inertial(
        2.3271207594,
        (-0.0016039605, 0.0292536262, -0.0972965990),
        (0.051610278, -0.005715173, -0.003567317, 0.047877297, 0.010673985, 0.016423626),
    ),
    "panda_link6": Inertial(
        1.8170376524,
        (0.0597131221, -0.0410294666, -0.0101692726),
        (0.005412334, 0.006193456, 0.001421929, 0.014058330, -0.001314075, 0.016080818),
    ),
    "panda_link7": Inertial(
        0.6271432862,
        (0.0045225817, 0.0086261921, -0.0161633251),
        (0.000210924, -2.4333e-05, 4.56448e-05, 0.000177186, 8.74407e-05, 5.99319e-05),
    ),
}

SOURCES = (
    "limits and inertias: the maker's franka_description, robots/fr3; speeds are the largest ones, where Franka allows "
    "less near the ends of joints",
    "acceleration: the maker's libfranka, rate_limiting.h",
    "motors' inertia: Franka's figures, in the README of Drake's franka_description",
)


def fr3() -> Robot:
    """The arm with seven joints and a payload of 3 kg that follows the Panda."""
    keys = ("lower", "upper", "velocity", "effort")
    limits = {f"panda_joint{i}": dict(zip(keys, limits, strict=True)) for i, limits in enumerate(LIMITS, 1)}
    return replace(
        panda(),
        name="fr3",
        title="Franka Research 3",
        urdf=mended("panda_description/urdf/panda.urdf", inertials=INERTIALS, limits=limits),
        acceleration_limits=(10.0,) * 7,
        aliases=(),
        measured=measured("fr3"),
        sources=SOURCES,
    )
