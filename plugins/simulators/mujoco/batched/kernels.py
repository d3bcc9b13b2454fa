"""Run on the device between two physics steps: set the servos' targets, and record states."""

from __future__ import annotations

from plugins.simulators.mujoco.batched.engine import warp as wp

LARGEST = 1e10  # of a state's numbers, beyond which MuJoCo calls it broken (mjMAXVAL)


@wp.func
def sampled(
    times: wp.array2d[wp.float64],
    values: wp.array3d[wp.float64],
    count: int,
    world: int,
    joint: int,
    time: wp.float64,
) -> wp.float64:
    """Interpolate linearly between times, constant before and after, as `JointTrajectory.sample` does.

    Args:
        times: of each world (W, T), seconds.
        values: of each world's joints (W, T, J).
        count: how many times this world has.
        world: its number.
        joint: its joint's number.
        time: when, seconds.
    """
    if time <= times[world, 0]:
        return values[world, 0, joint]
    if time >= times[world, count - 1]:
        return values[world, count - 1, joint]

    low = int(0)  # noqa: RUF046, UP018  # without int() it would be a constant
    high = count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if times[world, middle] <= time:
            low = middle
        else:
            high = middle

    share = (time - times[world, low]) / (times[world, high] - times[world, low])
    return values[world, low, joint] + share * (
        values[world, high, joint] - values[world, low, joint]
    )


@wp.kernel(enable_backward=False)
def drive(
    step: wp.array[int],
    begin: wp.array[int],
    broken: wp.array[int],
    dt: wp.float64,
    ahead: int,
    count: wp.array[int],
    times: wp.array2d[wp.float64],
    targets: wp.array3d[wp.float64],
    stiffness: wp.array2d[wp.float64],
    damping: wp.array2d[wp.float64],
    aim: wp.array2d[wp.float64],
    control: wp.array2d[float],
) -> None:
    """Set each joint's target at the step's end, and its servo's input; broken worlds stay at the start.

    Args:
        step: how many steps of the block are done (W,).
        begin: how many steps of the motion were done before the block (W,); below 0 while the worlds settle.
        broken: which worlds diverged (W,).
        dt: the time step, s.
        ahead: 1: servos get the target at the step's end; 0: at its beginning.
        count: the number of each world's times (W,).
        times: of its trajectory (W, T), s.
        targets: of its joints (W, T, J), rad or m.
        stiffness: of its servos (W, J).
        damping: of its servos (W, J).
        aim: gets the targets at the step's end (W, J).
        control: gets the servos' inputs (W, J).
    """
    world, joint = wp.tid()
    time = wp.float64(step[world] + begin[world]) * dt
    if broken[world] != 0:
        time = times[world, 0] - dt

    before = sampled(times, targets, count[world], world, joint, time)
    after = sampled(times, targets, count[world], world, joint, time + dt)
    aim[world, joint] = after

    # MuJoCo takes no such target either.
    if not wp.isfinite(after) or wp.abs(after) > wp.static(LARGEST):
        broken[world] = 1
        after = targets[world, 0, joint]
        before = after

    target = before
    if ahead != 0:
        target = after

    control[world, joint] = wp.float32(
        stiffness[world, joint] * target + damping[world, joint] * (after - before) / dt
    )


@wp.kernel(enable_backward=False)
def note(
    step: wp.array[int],
    last: wp.array[int],
    marks: wp.array2d[int],
    noted: wp.array[int],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    overflow: wp.array[int],
    crowded: wp.array[int],
    film: wp.array3d[float],
    lost: wp.array[int],
    astray: wp.array[int],
    broken: wp.array[int],
) -> None:
    """Record one number of a world's state before the step, if there is a mark.

    After a world's last step only divergence is recorded.

    Args:
        step: how many steps of the block are done (W,).
        last: how many the block has for each world (W,).
        marks: after how many of them a note is taken (W, F + 1), rising; -1 behind the last one.
        noted: how many notes each world has (W,).
        qpos: positions (W, Q).
        qvel: speeds (W, V).
        overflow: what MuJoCo Warp had no room for (W,).
        crowded: which worlds had too many contacts (W,).
        film: gets the notes (F, W, Q + V).
        lost: gets what there was no room for (W,).
        astray: gets which worlds diverge now (W,).
        broken: gets which worlds diverged before their end (W,).
    """
    world, number = wp.tid()
    positions = qpos.shape[1]
    value = float(0.0)  # noqa: UP018
    if number < positions:  # both sides of an expression would be read
        value = qpos[world, number]
    else:
        value = qvel[world, number - positions]

    now = step[world]

    if not wp.isfinite(value) or wp.abs(value) > wp.static(LARGEST):
        astray[world] = 1
        if now <= last[world]:
            broken[world] = 1

    if now > last[world]:
        return

    frame = noted[world]
    if marks[world, frame] == now:
        film[frame, world, number] = value

    if number == 0:
        lost[world] = overflow[world]
        if crowded[world] != 0:
            lost[world] = -1


@wp.kernel(enable_backward=False)
def leave_out(
    most: int,
    found: wp.array[int],
    world_of: wp.array[int],
    kind: wp.array[int],
    count: wp.array[int],
    crowded: wp.array[int],
) -> None:
    """Drop contacts of a world beyond ``most``, and mark the world as crowded.

    All worlds are marked if contacts were lost before their world was known.

    Args:
        most: how many a world has room for.
        found: how many contacts there are in all (1,).
        world_of: the world of each contact (C,).
        kind: what each is (C,); 0: none.
        count: how many each world has had so far (W,).
        crowded: gets which worlds had too many (W,).
    """
    number = wp.tid()
    if found[0] > kind.shape[0] and number < crowded.shape[0]:
        crowded[number] = 1
    if number >= wp.min(found[0], kind.shape[0]):
        return

    world = world_of[number]
    if wp.atomic_add(count, world, 1) >= most:
        kind[number] = 0
        crowded[world] = 1


@wp.kernel(enable_backward=False)
def cut(most: int, found: wp.array[int]) -> None:
    """Cut the number of contacts to the capacity."""
    found[0] = wp.min(found[0], most)


@wp.kernel(enable_backward=False)
def mend(
    astray: wp.array[int],
    first: wp.array2d[float],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warmstart: wp.array2d[float],
) -> None:
    """Reset a world that diverged, so that it does not slow down the others.

    Args:
        astray: which diverge (W,).
        first: the positions to begin with (W, Q).
        qpos: positions (W, Q).
        qvel: speeds (W, V).
        warmstart: what the solver begins with (W, V).
    """
    world = wp.tid()
    if astray[world] == 0:
        return

    for i in range(qpos.shape[1]):
        qpos[world, i] = first[world, i]

    for i in range(qvel.shape[1]):
        qvel[world, i] = 0.0
        warmstart[world, i] = 0.0

    astray[world] = 0


@wp.kernel(enable_backward=False)
def advance(step: wp.array[int], marks: wp.array2d[int], noted: wp.array[int]) -> None:
    """Count a step of each world (W,), and the note that was taken before it (W,) at one of its marks (W, F + 1)."""
    world = wp.tid()
    if marks[world, noted[world]] == step[world]:
        noted[world] = noted[world] + 1

    step[world] = step[world] + 1
