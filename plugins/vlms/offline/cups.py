"""Put a cup over a body that stands flat on the ground, tip both over, and carry the body in it; or turn it over.

Nothing gets under such a body. Walls around it turn it about its foremost edge, as a wrench turns a nut. Turned by more
than a right angle it lies in the cup, and is carried. Set down on that edge and turned back it stands as before. A ring
is a cup without a lid, and lets a body fall out on its other side.

The flange is tilted to one side first and to the other in the end: an arm that points down tilts by a right angle to
both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import LEVEL, UP
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.heads import Head, Piece, add_stem, make_cup, make_pen
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.subgoals import Extent, Subgoal

# Which bodies.
_MOST_M = 0.25  # their sides
_SHORT_M = 0.03  # a shorter way on the level is none
_ASIDES_RAD = np.radians(np.arange(-45.0, 46.0, 3.0))  # of headings that are tried
_SMALLER = 0.99  # of the ground that bodies take up along another heading, where that one counts

# The walls.
_SPARE_M = Range(0.0015, 0.005)  # between bodies and walls, on each side
_LEAST_ROOM_M = 0.0012  # that a body's diagonal is longer than the body: walls turn it if they leave less,
_ROOM = Range(0.4, 0.8)  # such as this share of it
_PLATE_M = 0.004  # thick, of the stiff default material
_WALLS = Range(0.75, 1.0)  # of the bodies' height
_LEAST_WALL_M = 0.012
_STEM_M = 0.018  # of a ring: thick, and above its walls
_OFF_M = Range(0.002, 0.004)  # above the ground, at any time
_LID_M = Range(0.001, 0.004)  # above bodies
_FLANGE_M = Range(0.13, 0.24)  # from the lid, or from the ring
_TILT_RAD = Range(0.8, 1.2)  # of the flange at first

# The way.
_TIP_RAD = Range(1.75, 2.15)  # past a right angle, so that bodies don't slide out
_STEP_RAD = 0.22  # between waypoints
_LIFT_M_S = Range(0.1, 0.3)
_CARRY_M_S = Range(0.15, 0.4)
_LOWER_M_S = 0.1
_MORE_M = Range(0.0, 0.03)  # than bodies must be lifted
_PASS_M = Range(0.01, 0.03)  # above what is on the way
_LEAVE_M = 0.05  # up from what was set down
# Turned by so much, bodies stand in the ring, and are moved.
_STANDS_RAD = Range(1.2, 1.45)
_FALLS_RAD = Range(1.75, 2.8)  # from here on they fall out of it
_RETURNS = Range(0.0, 1.1)  # of the way by which they get ahead as they fall over
_BACK_M = 0.04  # a ring leaves by, and up


def suits_cup(subgoal: Subgoal) -> bool:
    """Report whether a subgoal's only body has to be lifted, and is one that walls around it can tip.

    Args:
        subgoal: of which nothing gets below its body.
    """
    goal = subgoal.goal
    if goal is None or len(subgoal.solids) > 1 or subgoal.riders:
        return False

    moves = subgoal.length > _SHORT_M and not subgoal.falls
    # What bars the way of one of several may be another of them, and yields.
    barred = moves and not subgoal.alone and subgoal.is_blocked(subgoal.shift)
    keeps_upright = goal.steady or (subgoal.is_held and goal.axis is not None)
    if keeps_upright or not (subgoal.rises or barred):
        return False

    return is_turned_by_walls(subgoal)


def is_turned_by_walls(subgoal: Subgoal) -> bool:
    """Report whether walls around a body turn it about its edge: it is rigid, no ball, not large and not very flat.

    Args:
        subgoal: with one body.
    """
    shapes = [geom.shape for geom in subgoal.solids[0].body.collisions]
    if not shapes or all(shape.is_ball for shape in shapes):
        return False

    extent = subgoal.extent(find_heading(subgoal, 1.0))
    large = max(subgoal.height, extent.across) > _MOST_M
    return not large and _find_room(subgoal, extent, subgoal.height) > _LEAST_ROOM_M


def draw_cup(subgoal: Subgoal, rng: Generator, thickness_factor: float) -> Head:
    """Draw a cup for a body; the flange is tilted against the way that it tips.

    Args:
        subgoal: with one body.
        rng: random numbers.
        thickness_factor: how many times as thick as of the stiff default material walls are.
    """
    height = subgoal.height * _WALLS.draw(rng)
    side = draw_side(rng)
    heading = find_heading(subgoal, side)
    thick = _PLATE_M * thickness_factor
    walls = _draw_walls(make_cup, subgoal, heading, rng, height, thick)
    return hang(walls, side, _TILT_RAD.draw(rng), rng)


def draw_plain_cup(
    subgoal: Subgoal, heading: float, rng: Generator, thickness_factor: float
) -> Head:
    """Draw a cup for a body that does not hang from a flange yet.

    Args:
        subgoal: with one body.
        heading: along which the body is tipped, radians about z.
        rng: random numbers.
        thickness_factor: see `draw_cup`.
    """
    height = subgoal.height * _WALLS.draw(rng)
    thick = _PLATE_M * thickness_factor
    return _draw_walls(make_cup, subgoal, heading, rng, height, thick)


def _draw_walls(
    make: Callable[[float, float, float, float], Head],
    subgoal: Subgoal,
    heading: float,
    rng: Generator,
    height: float,
    thick: float,
) -> Head:
    """Draw walls around a body.

    Args:
        make: makes a head of its width, depth and height, inside, and the walls' thickness, metres.
        subgoal: with the body.
        heading: along which the body is tipped, radians about z.
        rng: random numbers.
        height: of the walls, metres.
        thick: of the walls, metres.
    """
    extent = subgoal.extent(heading)
    spare = _SPARE_M.draw(rng)
    room = _find_room(subgoal, extent, height) * _ROOM.draw(rng)
    along = extent.along + min(2 * spare, room)
    return make(extent.across + 2 * spare, along, max(_LEAST_WALL_M, height), thick)


def _find_room(subgoal: Subgoal, extent: Extent, height: float) -> float:
    """Find the most room that walls may leave a body which they are to turn, metres.

    It is by how much the diagonal is longer than the body.

    Args:
        subgoal: with the body.
        extent: along the heading.
        height: of the walls, metres.
    """
    held = min(height, subgoal.height - _OFF_M.high)
    return float(np.hypot(extent.along, held) - extent.along)


def tip_in(path: HeadPath, subgoal: Subgoal, head: Head, rng: Generator) -> str:
    """Come down over the body, tip it into the cup, and carry it; what is not to be held is set down and left.

    Args:
        path: that waypoints are added to.
        subgoal: with one body.
        head: a cup.
        rng: random numbers.

    Returns:
        What it does, in words, as a part of the sentence that describes the plan.
    """
    angle = _TIP_RAD.draw(rng)
    extent = subgoal.extent(find_heading(subgoal, _read_side(head)))
    poses = tip_over_edge(subgoal, extent, head, angle, rng)
    text = f"tips the body into a cup by {np.degrees(angle):.0f} degrees"

    path.descend(subgoal, poses[0], poses[0].position)
    for pose in poses[1:]:
        path.add(pose, touch=True)
    path.hold()

    tipped = poses[-1]
    here = tipped.position
    high = subgoal.shift[2] + _MORE_M.draw(rng)
    moves = subgoal.length > _SHORT_M
    if moves:
        over = subgoal.height_on_way - subgoal.lower[2] + _PASS_M.draw(rng)
        high = max(high, over)
    path.move(here + high * UP, tipped, _LIFT_M_S.draw(rng))

    stays = subgoal.is_held or (subgoal.rises and not moves)
    if stays and not subgoal.is_released:
        if moves:
            # Tipping has moved the body's middle, too.
            middle = (tipped @ poses[0].inverse()).apply(subgoal.center)
            aside = (middle - subgoal.center) * LEVEL
            there = path.end + subgoal.shift * LEVEL - aside
            path.move(there, tipped, _CARRY_M_S.draw(rng))
        return f"{text}, and lifts it by {high:.2f} m"

    path.move(path.end + subgoal.shift * LEVEL, tipped, _CARRY_M_S.draw(rng))
    verb = "lets it fall"
    if not subgoal.falls_in:
        path.move(here + subgoal.shift, tipped, _LOWER_M_S)
        verb = "sets it down"

    # Back as it came, and away.
    moved = path.end - here
    for pose in reversed(poses[:-1]):
        path.go(pose, pose.position + moved, touch=True)
    path.go(poses[0], path.end + (subgoal.height + _LEAVE_M) * UP, touch=True)

    return f"{text}, carries it by {subgoal.length:.2f} m and {verb}"


def tip_over_edge(
    subgoal: Subgoal, extent: Extent, cup: Head, angle: float, rng: Generator
) -> list[Pose]:
    """Tip a cup with a body about the body's foremost edge; return poses of the cup, the first one over the body.

    Args:
        subgoal: with the body.
        extent: along the heading.
        cup: around the body.
        angle: at the end, radians.
        rng: random numbers.
    """
    lid = cup.pieces[1]
    inside = lid.pose.position[2] - lid.size[2] / 2
    foot = max(
        subgoal.upper[2] + _LID_M.draw(rng) - inside,
        subgoal.lower[2] + _OFF_M.draw(rng),
    )
    return _turn_over_edge(subgoal, extent, cup, foot, angle)


def make_flipper(subgoal: Subgoal, rng: Generator) -> Head:
    """Make a ring that turns a flat body over.

    Args:
        subgoal: with one body, lower than it is long.
        rng: random numbers.
    """
    side = draw_side(rng)
    extent = subgoal.extent(find_heading(subgoal, side))
    walls = _draw_walls(
        _make_ring, subgoal, extent.heading, rng, subgoal.height, _PLATE_M
    )
    ring = hang(walls, side, _TILT_RAD.draw(rng), rng)

    def flip(path: HeadPath, rng: Generator) -> str:
        """Come down around the body, turn it over its edge, move it as it stands, let it fall, and leave."""
        angle = _FALLS_RAD.draw(rng)
        stands = _STANDS_RAD.draw(rng)
        foot = float(subgoal.lower[2]) + _OFF_M.draw(rng)
        rising = _turn_over_edge(subgoal, extent, ring, foot, stands)
        falling = _turn_over_edge(subgoal, extent, ring, foot, angle)

        path.descend(subgoal, rising[0], rising[0].position)
        for pose in rising[1:]:
            path.add(pose, touch=True)

        # Over its edge the body gets ahead by its length and its height.
        ahead = (extent.along + subgoal.height) * _RETURNS.draw(rng)
        way = (subgoal.shift @ extent.ahead - ahead) * extent.ahead
        path.move(path.end + way, rising[-1], _CARRY_M_S.draw(rng))
        for pose in falling[len(rising) :]:
            path.go(pose, pose.position + way, touch=True)

        away = path.end - _BACK_M * extent.ahead + _LEAVE_M * UP
        path.go(path.poses[-1], away, touch=True)
        return (
            "comes down around the body, and turns it over its edge by "
            f"{np.degrees(angle):.0f} degrees"
        )

    return replace(ring, motion=flip)


def _make_ring(width: float, depth: float, height: float, thick: float) -> Head:
    """Make a pen with a stem for the shaft on its rear wall; see `make_pen`."""
    pen = make_pen(width, depth, height, thick)
    stemmed = add_stem(pen, height + _STEM_M, _STEM_M)
    return replace(stemmed, kind="ring", primitive="guided")


def draw_side(rng: Generator) -> float:
    """Draw to which side, seen from the arm, a cup tips: 1 is left."""
    return float(rng.choice([-1.0, 1.0]))


def find_heading(subgoal: Subgoal, side: float) -> float:
    """Find the heading across the way from the arm, or near it, along which bounds of the body are smallest.

    Args:
        subgoal: with one body.
        side: see `draw_side`.
    """
    across = subgoal.workspace.direction(subgoal.center) + side * np.pi / 2
    best = across
    least = np.inf
    for aside in sorted(_ASIDES_RAD, key=abs):
        extent = subgoal.extent(across + aside)
        ground = extent.along * extent.across
        if ground < _SMALLER * least:
            best = across + aside
            least = ground

    return float(best)


def hang(head: Head, side: float, tilt: float, rng: Generator) -> Head:
    """Hang a head from the flange, which is tilted back against the way that it will turn.

    Args:
        head: a cup or a ring.
        side: see `draw_side`.
        tilt: of the flange, radians.
        rng: random numbers.
    """
    # The flange is not turned about itself.
    tilted = Pose.xyz_rpy(head.attachment, (0.0, -tilt, 0.0))
    turned = Pose.xyz_rpy(_FLANGE_M.draw(rng) * UP, (0.0, 0.0, -side * np.pi / 2))
    return replace(head, mount_pose=(tilted @ turned).inverse())


def _read_side(head: Head) -> float:
    """Read to which side a head tips; see `hang`."""
    assert head.mount_pose is not None
    return float(np.sign(head.mount_pose.rotation_matrix[1, 0]))


def _turn_over_edge(
    subgoal: Subgoal, extent: Extent, head: Head, foot: float, angle: float
) -> list[Pose]:
    """Turn a head with a body about the body's foremost edge, clear of the ground; return poses of the head.

    Args:
        subgoal: with the body.
        extent: along the heading.
        head: around the body.
        foot: of the head at first, in the world, metres.
        angle: at the end, radians.
    """
    around = (head.depth - extent.along) / 2
    place = (extent.rear - around) * extent.ahead + extent.middle
    start = Pose.xyz_rpy((*place[:2], foot), (0.0, 0.0, extent.heading))

    ground = float(subgoal.lower[2])
    edge = extent.front * extent.ahead + extent.middle + ground * UP
    axis = np.cross(UP, extent.ahead)
    corners = np.concatenate([_find_corners(piece) for piece in head.pieces])
    clear = min(foot - ground, _OFF_M.high)

    poses = [start]
    for share in np.linspace(0.0, 1.0, int(np.ceil(angle / _STEP_RAD)) + 1)[1:]:
        turn = Rotation.from_rotvec(share * angle * axis)
        about = Pose.from_rotation(edge - turn.apply(edge), turn)
        turned = about @ start
        lowest = float(turned.apply(corners)[:, 2].min())
        raised = max(0.0, ground + clear - lowest)
        poses.append(Pose(turned.position + raised * UP, turned.quaternion))

    return poses


def _find_corners(piece: Piece) -> Array:
    """Find the corners (8, 3) of a piece in the head's frame."""
    signs = np.array([*product((-0.5, 0.5), repeat=3)])
    return piece.pose.apply(signs * piece.size)
