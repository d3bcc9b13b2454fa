"""The catalogue of what a design is refused for; plugins define their own (`core.errors.Reason`)."""

from core.errors import Reason


class DesignReason(Reason):
    """What a design breaks."""

    # --- tools --------------------------------------------------------------------------------------------------------

    NO_COMPONENTS = "the tool has no components; hang at least one from {mounts}"
    COUNT = "the tool has {count} components; at most {most} are allowed"
    NAME = "component name {name} is not 1 to 64 letters, digits, '_', '.' or '-'"
    NAMED_TWICE = "two parts of the tool are named {name!r}; each needs its own name"
    NO_PARENT = (
        "component {component!r} hangs from {parent!r}, which is neither a component before it nor the mount "
        "({mounts})"
    )
    SIDE = "component {component!r} is {side_m:.6g} m long in {axis}; it must be between {least_m:g} and {most_m:g} m"
    MASS = "component {component!r} weighs {mass_kg:.6g} kg; it must be between {least_kg:g} and {most_kg:g} kg"
    DENSITY = (
        "component {component!r} weighs {mass_kg:.6g} kg in {volume_m3:.3g} m^3, a density of "
        "{density_kg_m3:.3g} kg/m^3; it must be between {least_kg_m3:g} and {most_kg_m3:g} kg/m^3"
    )
    TOO_LIGHT = "the tool weighs {mass_kg:.3g} kg; at least {least_kg:g} kg is needed"
    TOO_HEAVY = (
        "the tool weighs {mass_kg:.3g} kg; {limit}; component {heaviest!r} weighs most, {heaviest_kg:.3g} kg: "
        "make parts thinner, shorter or fewer"
    )
    MOMENT = (
        "the tool, of {mass_kg:.3g} kg, turns the wrist with {moment_n_m:.3g} N m, its centre of mass being "
        "{away_m:.3g} m from the mount; at most {most_n_m:g} N m are allowed; component {heaviest!r} weighs "
        "most, {heaviest_kg:.3g} kg: make parts thinner, shorter or fewer, or bring heavy parts closer to the "
        "mount"
    )
    EXTENT = (
        "component {component!r} reaches {reach_m:.3g} m from {mount}; a tool must end within {most_m:g} m of "
        "its mount"
    )
    GAP = (
        "component {component!r} is {gap_mm:.1f} mm away from its {neighbour}; move it by {way}, or lengthen it"
        " until they touch"
    )
    NO_GRIPPER = "{robot} has no gripper; design one rigid tool, with 'gripper' false"
    WEAK = "{weakness}"

    # --- joints of tools ----------------------------------------------------------------------------------------------

    JOINT_AXIS = "a joint's axis needs a length: give for example 0 0 1"
    JOINT_RANGE = (
        "a joint's range must hold 0, and more than 0; it is {lower:g} to {upper:g}"
    )
    JOINT_NEGATIVE = "a joint's {name} must be 0 or more, not {given:g}"

    # --- fixtures -----------------------------------------------------------------------------------------------------

    NO_PLACE = "{task} has no place for a fixture; leave 'fixture' out"
    FIXTURE_JOINT = "fixture: a component has a joint, and a fixture has none"
    FIXTURE_OUTSIDE = "component {component!r} of the fixture is not within the task's region, {low} to {high}"
    FIXTURE_INSIDE = "component {component!r} of the fixture starts {depth_mm:.1f} mm inside {other!r}; move it"
    FIXTURE_HANGS = "component {component!r} of the fixture hangs in the air, {gap_mm:.1f} mm from what is fixed"

    # --- the start ----------------------------------------------------------------------------------------------------

    START_INSIDE = "component {component!r} starts {depth} {other}{mend}"
    TRAPPED = (
        "nothing could have brought the {what} to its start: even straight out along {direction} {part} goes "
        "through {body!r}, and no way around was found; start outside, and let the plan bring it in"
    )

    # --- fields of a design -------------------------------------------------------------------------------------------

    NO_OBJECT = "{what} is {given}, not an object"
    GRIPPER_WORD = "'gripper' is {given}; it must be true or false"
    ACTION_WORD = "'action' is {given}; it must be the name of an action representation"

    # --- plans --------------------------------------------------------------------------------------------------------

    PLAN_LIST = "an action plan must be a list of waypoints, not {given}"
    PLAN_COUNT = (
        "the action plan has {count} waypoints; between {least} and {most} are needed"
    )
    WAYPOINT_LIST = "{where} must be a list of {needed} numbers, not {given}"
    WAYPOINT_COUNT = "{where} has {count} numbers, {needed} are needed: {names}"
    WAYPOINT_NUMBER = "{where}: {name} must be a number, not {given}"
    WAYPOINT_RANGE = "{where}: {name} is {given!r:.20}; it must be between {least:g} and {most:g} {unit}"
    WAYPOINT_FAR = "{where} is {away_m:.2f} m from the world's origin; at most {most_m:g} m are allowed"
    WAY_LENGTH = (
        "the way through the waypoints is {way_m:.0f} m and {turn_rad:.0f} rad long; at most {most} steps are "
        "allowed, each of {step_m:g} m or {step_rad:g} rad and at least one to each waypoint, and it takes "
        "{steps}"
    )
    TEMPO = "waypoint {waypoint}: a {name} of {given:g} is too small; give {least:g} or more"
    PLAN_TIME = "the plan asks for {time_s:.4g} s; at most {most_s:g} s are allowed"
    LOOP_TIME = "with all its loops the plan may ask for {time_s:.4g} s; at most {most_s:g} s are allowed"
    MOTION_TIME = (
        "the motion takes {time_s:.1f} s under the arm's limits, more than {most_s:.0f} s; "
        "use fewer waypoints"
    )
    MOTION_POSES = (
        "the tool's {count} parts would be looked at {rate_hz:.0f} times a second for {time_s:.0f} s, which is "
        "{poses:.2g} poses; at most {most:.2g} are computed: move slower, or use fewer and thicker parts"
    )
    ARM_IN_ITSELF = "{where}; {mend}"
