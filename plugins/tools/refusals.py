"""What a tool is refused for while it is read, and what its joints are."""

from core.errors import Reason


class ToolReason(Reason):
    """What a tool breaks while it is read, and what its joints do."""

    # --- components ---------------------------------------------------------------------------------------------------

    FIELD_MISSING = "{field} is missing; give {wanted}"
    FIELD_LIST = "{field} must be a list of components, not {given}"
    FIELD_TEXT = "{field} must be a text of <link> and <joint> elements, not {given}"
    FIELD_COUNT = "{field} has {count} components; at most {most} are allowed"
    FIELD_LENGTH = "{field} is {count} characters long; at most {most} are allowed"
    PARENT_MISSING = "{where}: parent must be the name of a component or of {mounts}"
    PARENT_CIRCLE = "parents lead from {name!r} in a circle; hang it from {mounts}"
    PARENT_UNKNOWN = (
        "{what} {name!r} hangs from {parent}, which is neither a {what} of the tool nor its mount "
        "({mounts})"
    )
    COMPONENT_OBJECT = "{where} must be an object, not {given}"
    NAME_MISSING = (
        "{where} has no name; give it one of letters, digits, '_', '.' or '-'"
    )
    NAME_LETTERS = (
        "{where}: its name {name} is not 1 to 64 letters, digits, '_', '.' or '-'"
    )
    NAME_OF_ROBOT = "{where}: its name {name!r} is the robot's own; choose another"
    NAME_TAKEN = "two components are named {name!r}; each needs its own name"
    SHAPE = "{where}: shape must be one of {possible}, not {given}"

    # --- URDF ---------------------------------------------------------------------------------------------------------

    TAG = "<{tag}> is not allowed; use <link>, <joint> and <material>"
    TAG_COUNT = "the tool has {count} <{tag}> elements; at most {most} are allowed"
    TAG_TWICE = "a <{within}> has {count} <{tag}> elements; give one"
    LINK_LOOSE = "no joint holds link {name!r}; hang it from {mounts} or another link"
    LINK_NAME = "{tag} name {name} is not 1 to {most} letters, digits, '_', '.' or '-'"
    LINK_OF_ROBOT = "{tag} {name!r} is the robot's own; the block holds only the tool's links and joints"
    LINK_SHAPE = (
        'link {name!r}: boxes only; expected <box size="x y z"/>, found <{found}>'
    )
    LINK_EMPTY = (
        "link {name!r} hangs on a joint that moves, and has no box; give it one"
    )
    JOINT_TYPE = "{where} is of type {given}; {wanted}"
    JOINT_LIMIT = '{where} needs <limit lower="..." upper="..."/>'

    # --- solids -------------------------------------------------------------------------------------------------------

    SOLID_VOLUME = (
        "has a volume of {volume_mm3:.3g} mm^3: check what is taken away, and where"
    )
    SOLID_TRIANGLES = (
        "has more than {most} triangles; use fewer curved shapes and holes"
    )
    SOLIDS_TRIANGLES = (
        "{where}: with it the tool's solids have {count} triangles; at most {most} are allowed: use fewer or "
        "smaller spheres and revolutions (a whole component that is one sphere is free)"
    )
    SOLID_CONVEX = (
        "can't be made of convex parts within {within_mm:g} mm: they differ by {off_mm:.2f} mm; make thin "
        "curved walls thicker, and avoid sharp rims"
    )
    SOLID_PARTS = (
        "needs {needed} convex parts to keep within {within_mm:g} mm{problem}; at most {most} are allowed for a"
        " tool{left}: make round hollows smaller or flat-walled, or leave some out"
    )
    SOLID_PIECES = "falls into {count} pieces; {wanted}"
    SOLID_NODES = (
        "{where}: the tool's solids have more than {most} shapes in all; use fewer"
    )
    SOLID_DEPTH = (
        "{where} nests more than {most} deep; use fewer operations within each other"
    )
    SOLID_OBJECT = (
        '{where} must be an object such as {{"box": [0.02, 0.02, 0.1]}}, not {given}'
    )
    SOLID_JSON = "{where}{problem}"
    SOLID_KIND = "{where} must have exactly one of {possible}; it has {found}"

    # --- joints -------------------------------------------------------------------------------------------------------

    JOINT_COUNT = "the tool has {count} moving joints; at most {most} are allowed"
    JOINT_WIDE = (
        "goes from {lower:g} to {upper:g} {unit}; at most {most:.3g} is allowed"
    )
    JOINT_NARROW = "goes from {lower:g} to {upper:g} {unit}; give it a range of {least:g} or more, or no joint"
    SPRING_REST = "has a spring that is relaxed at {rest:g} {unit}; at most {most:.3g}"
    JOINT_LIGHT = "moves {mass_kg:.2g} kg; at least {least_kg:g} kg is needed"
    SPRING_STIFF = (
        "has too stiff a spring: what it moves would swing at {rate_hz:.0f} Hz, and at most {most_hz:g} can be "
        "simulated; a stiffness of {would_do:.2g} would do, or more mass"
    )
    DAMPING_FAST = (
        "has too much damping: {damping:g} for an inertia of {inertia:.2g}; at most {most:.2g} can be "
        "simulated; for more resistance give friction"
    )
    SPRING_STRONG = (
        "has too strong a spring: it exerts {load:.3g} {load_unit} where it is {strain:.3g} {unit} from its "
        "rest; at most {most:.2g} {load_unit} are allowed"
    )
    JOINT_MOST = "has {what} of {given:.3g} {unit}; at most {most:g} is allowed"
    SPRINGS_ENERGY = (
        "the tool's springs hold {energy_j:.3g} J at the ends of their ranges; at most {most_j:.2g} J are "
        "allowed: give {component!r} a smaller range or a softer spring"
    )
    SPRINGS_SPEED = (
        "the tool's springs could make {component!r} {speed_m_s:.3g} m/s fast; at most {most_m_s:g} m/s are "
        "allowed: give it more mass, a smaller range or a softer spring"
    )
    HINGE_PIN = (
        "the hinge of {component!r} has an axis that passes {side!r} at {away_mm:.0f} mm; at most {most_mm:g} "
        "mm are allowed: put the axis where both are, or add an eye for its pin"
    )
    JOINT_LEAVES = (
        "component {component!r} leaves what bears it, {parent!r}, where its joint is at {place:.3g} {unit}: "
        "shorten the range, or add a rail that goes on touching"
    )
    JOINT_THROUGH = (
        "component {component!r} goes through {other!r} of its own tool, where the joint of {bearer!r} is at "
        "{place:.3g} {unit}: end the range before"
    )

    # --- grips --------------------------------------------------------------------------------------------------------

    GRIP_OF_FIXTURE = "fixture: a component of it has 'grips', and a fixture holds nothing; leave it out"
    GRIP_OF_FINGERS = "a component has 'grips', and the tool hangs from the fingers; only a rigid tool can grip"
    GRIP_COUNT = "{count} components have 'grips'; at most {most} are allowed"
    GRIP_MOVES = "component {component!r} has 'grips' and moves on the joint of {bearer!r}; hang it from what is rigid"
    GRIP_AREA = (
        "component {component!r}: a round patch of {area_mm2:g} mm^2 is {across_mm:.1f} mm across, more than its face "
        "{face}; make the face wider or the area smaller"
    )
    GRIP_FLAT = (
        "component {component!r}: its face {face} is {off_mm:.1f} mm off a plane where the patch is; grip with a flat "
        "face"
    )
