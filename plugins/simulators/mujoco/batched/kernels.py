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
    settle: wp.array[int],
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
        step: how many steps are done (1,).
        settle: how many let each world settle (W,).
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
    time = wp.float64(step[0] - settle[world]) * dt
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
def release(
    step: wp.array[int],
    settle: wp.array[int],
    own_stiffness: wp.array2d[float],
    own_friction: wp.array2d[float],
    stiffness: wp.array2d[float],
    friction: wp.array2d[float],
) -> None:
    """Give joints their springs and dry friction when the motion begins.

    Args:
        step: how many steps are done (1,).
        settle: how many let each world settle (W,).
        own_stiffness: what joints have (W, N).
        own_friction: what degrees of freedom have (W, V).
        stiffness: the model's (W, N).
        friction: the model's (W, V).
    """
    world, number = wp.tid()
    if step[0] == settle[world]:
        friction[world, number] = own_friction[world, number]
        if number < stiffness.shape[1]:
            stiffness[world, number] = own_stiffness[world, number]


@wp.kernel(enable_backward=False)
def note(
    step: wp.array[int],
    settle: wp.array[int],
    last: wp.array[int],
    every: wp.array[int],
    look: int,
    arm: int,
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    aim: wp.array2d[wp.float64],
    overflow: wp.array[int],
    crowded: wp.array[int],
    start: wp.array2d[float],
    end: wp.array2d[float],
    film: wp.array3d[float],
    lag: wp.array[wp.float64],
    lost: wp.array[int],
    astray: wp.array[int],
    broken: wp.array[int],
) -> None:
    """Record one number of a world's state before the step. After a world's last step only divergence is recorded.

    Args:
        step: how many steps are done (1,).
        settle: how many let each world settle (W,).
        last: how many each world plays (W,).
        every: the steps between two samples of its recording (W,); 0: none.
        look: the steps between two measurements of the lag.
        arm: how many joints the arm has.
        qpos: positions (W, Q).
        qvel: speeds (W, V).
        aim: the targets after the last step (W, J).
        overflow: what MuJoCo Warp had no room for (W,).
        crowded: which worlds had too many contacts (W,).
        start: gets the state when the motion begins (W, Q + V).
        end: gets the state at the end (W, Q + V).
        film: gets the samples (F, W, Q + V).
        lag: gets the largest of an arm joint (W,), rad or m.
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

    now = step[0]

    if not wp.isfinite(value) or wp.abs(value) > wp.static(LARGEST):
        astray[world] = 1
        if now <= last[world]:
            broken[world] = 1

    if now > last[world]:
        return

    if now == settle[world]:
        start[world, number] = value
    if now == last[world]:
        end[world, number] = value
    if every[world] > 0 and now < last[world] and now % every[world] == 0:
        film[now // every[world], world, number] = value

    if number == 0:
        lost[world] = overflow[world]
        if crowded[world] != 0:
            lost[world] = -1

    if number < arm and now > settle[world] and (now - 1) % look == 0:
        wp.atomic_max(lag, world, wp.abs(wp.float64(value) - aim[world, number]))


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
def advance(step: wp.array[int]) -> None:
    """Count a step (1,)."""
    step[0] = step[0] + 1
