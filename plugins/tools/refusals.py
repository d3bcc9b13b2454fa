"""What a tool is refused for while it is read, and what its joints are."""

from core.errors import Reason

# --- components -------------------------------------------------------------------------------------------------

FIELD_MISSING = Reason("E_FIELD_MISSING", "{field} is missing; give {wanted}")
FIELD_LIST = Reason("E_FIELD_LIST", "{field} must be a list of components, not {given}")
FIELD_TEXT = Reason(
    "E_FIELD_TEXT",
    "{field} must be a text of <link> and <joint> elements, not {given}",
)
FIELD_COUNT = Reason(
    "E_FIELD_COUNT", "{field} has {count} components; at most {most} are allowed"
)
FIELD_LENGTH = Reason(
    "E_FIELD_LENGTH", "{field} is {count} characters long; at most {most} are allowed"
)
PARENT_MISSING = Reason(
    "E_PARENT_MISSING",
    "{where}: parent must be the name of a component or of {mounts}",
)
PARENT_CIRCLE = Reason(
    "E_PARENT_CIRCLE", "parents lead from {name!r} in a circle; hang it from {mounts}"
)
PARENT_UNKNOWN = Reason(
    "E_PARENT_UNKNOWN",
    "{what} {name!r} hangs from {parent}, which is neither a {what} of the tool nor its mount ({mounts})",
)
COMPONENT_OBJECT = Reason(
    "E_COMPONENT_OBJECT", "{where} must be an object, not {given}"
)
NAME_MISSING = Reason(
    "E_NAME_MISSING",
    "{where} has no name; give it one of letters, digits, '_', '.' or '-'",
)
NAME_LETTERS = Reason(
    "E_NAME_LETTERS",
    "{where}: its name {name} is not 1 to 64 letters, digits, '_', '.' or '-'",
)
NAME_OF_ROBOT = Reason(
    "E_NAME_OF_ROBOT", "{where}: its name {name!r} is the robot's own; choose another"
)
NAME_TAKEN = Reason(
    "E_NAME_TAKEN", "two components are named {name!r}; each needs its own name"
)
SHAPE = Reason("E_SHAPE", "{where}: shape must be one of {possible}, not {given}")

# --- URDF -------------------------------------------------------------------------------------------------------

TAG = Reason("E_TAG", "<{tag}> is not allowed; use <link>, <joint> and <material>")
TAG_COUNT = Reason(
    "E_TAG_COUNT", "the tool has {count} <{tag}> elements; at most {most} are allowed"
)
TAG_TWICE = Reason("E_TAG_TWICE", "a <{within}> has {count} <{tag}> elements; give one")
LINK_LOOSE = Reason(
    "E_LINK_LOOSE",
    "no joint holds link {name!r}; hang it from {mounts} or another link",
)
LINK_NAME = Reason(
    "E_LINK_NAME",
    "{tag} name {name} is not 1 to {most} letters, digits, '_', '.' or '-'",
)
LINK_OF_ROBOT = Reason(
    "E_LINK_OF_ROBOT",
    "{tag} {name!r} is the robot's own; the block holds only the tool's links and joints",
)
LINK_SHAPE = Reason(
    "E_LINK_SHAPE",
    'link {name!r}: boxes only; expected <box size="x y z"/>, found <{found}>',
)
LINK_EMPTY = Reason(
    "E_LINK_EMPTY",
    "link {name!r} hangs on a joint that moves, and has no box; give it one",
)
JOINT_TYPE = Reason("E_JOINT_TYPE", "{where} is of type {given}; {wanted}")
JOINT_LIMIT = Reason("E_JOINT_LIMIT", '{where} needs <limit lower="..." upper="..."/>')

# --- solids -----------------------------------------------------------------------------------------------------

SOLID_VOLUME = Reason(
    "E_SOLID_VOLUME",
    "has a volume of {volume_mm3:.3g} mm^3: check what is taken away, and where",
)
SOLID_TRIANGLES = Reason(
    "E_SOLID_TRIANGLES",
    "has more than {most} triangles; use fewer curved shapes and holes",
)
SOLIDS_TRIANGLES = Reason(
    "E_SOLIDS_TRIANGLES",
    "{where}: with it the tool's solids have {count} triangles; at most {most} are allowed: use fewer or smaller "
    "spheres and revolutions (a whole component that is one sphere is free)",
)
SOLID_CONVEX = Reason(
    "E_SOLID_CONVEX",
    "can't be made of convex parts within {within_mm:g} mm: they differ by {off_mm:.2f} mm; make thin curved walls "
    "thicker, and avoid sharp rims",
)
SOLID_PARTS = Reason(
    "E_SOLID_PARTS",
    "needs {needed} convex parts to keep within {within_mm:g} mm{problem}; at most {most} are allowed for a tool"
    "{left}: make round hollows smaller or flat-walled, or leave some out",
)
SOLID_PIECES = Reason("E_SOLID_PIECES", "falls into {count} pieces; {wanted}")
SOLID_NODES = Reason(
    "E_SOLID_NODES",
    "{where}: the tool's solids have more than {most} shapes in all; use fewer",
)
SOLID_DEPTH = Reason(
    "E_SOLID_DEPTH",
    "{where} nests more than {most} deep; use fewer operations within each other",
)
SOLID_OBJECT = Reason(
    "E_SOLID_OBJECT",
    '{where} must be an object such as {{"box": [0.02, 0.02, 0.1]}}, not {given}',
)
SOLID_JSON = Reason("E_SOLID_JSON", "{where}{problem}")
SOLID_KIND = Reason(
    "E_SOLID_KIND", "{where} must have exactly one of {possible}; it has {found}"
)

# --- joints -----------------------------------------------------------------------------------------------------

JOINT_COUNT = Reason(
    "E_JOINT_COUNT", "the tool has {count} moving joints; at most {most} are allowed"
)
JOINT_WIDE = Reason(
    "E_JOINT_WIDE",
    "goes from {lower:g} to {upper:g} {unit}; at most {most:.3g} is allowed",
)
JOINT_NARROW = Reason(
    "E_JOINT_NARROW",
    "goes from {lower:g} to {upper:g} {unit}; give it a range of {least:g} or more, or no joint",
)
SPRING_REST = Reason(
    "E_SPRING_REST",
    "has a spring that is relaxed at {rest:g} {unit}; at most {most:.3g}",
)
JOINT_LIGHT = Reason(
    "E_JOINT_LIGHT", "moves {mass_kg:.2g} kg; at least {least_kg:g} kg is needed"
)
SPRING_STIFF = Reason(
    "E_SPRING_STIFF",
    "has too stiff a spring: what it moves would swing at {rate_hz:.0f} Hz, and at most {most_hz:g} can be simulated; "
    "a stiffness of {would_do:.2g} would do, or more mass",
)
DAMPING_FAST = Reason(
    "E_DAMPING_FAST",
    "has too much damping: {damping:g} for an inertia of {inertia:.2g}; at most {most:.2g} can be simulated; for more "
    "resistance give friction",
)
SPRING_STRONG = Reason(
    "E_SPRING_STRONG",
    "has too strong a spring: it exerts {load:.3g} {load_unit} where it is {strain:.3g} {unit} from its rest; at most "
    "{most:.2g} {load_unit} are allowed",
)
JOINT_MOST = Reason(
    "E_JOINT_MOST", "has {what} of {given:.3g} {unit}; at most {most:g} is allowed"
)
SPRINGS_ENERGY = Reason(
    "E_SPRINGS_ENERGY",
    "the tool's springs hold {energy_j:.3g} J at the ends of their ranges; at most {most_j:.2g} J are allowed: give "
    "{component!r} a smaller range or a softer spring",
)
SPRINGS_SPEED = Reason(
    "E_SPRINGS_SPEED",
    "the tool's springs could make {component!r} {speed_m_s:.3g} m/s fast; at most {most_m_s:g} m/s are allowed: give "
    "it more mass, a smaller range or a softer spring",
)
HINGE_PIN = Reason(
    "E_HINGE_PIN",
    "the hinge of {component!r} has an axis that passes {side!r} at {away_mm:.0f} mm; at most {most_mm:g} mm are "
    "allowed: put the axis where both are, or add an eye for its pin",
)
JOINT_LEAVES = Reason(
    "E_JOINT_LEAVES",
    "component {component!r} leaves what bears it, {parent!r}, where its joint is at {place:.3g} {unit}: shorten the "
    "range, or add a rail that goes on touching",
)
JOINT_THROUGH = Reason(
    "E_JOINT_THROUGH",
    "component {component!r} goes through {other!r} of its own tool, where the joint of {bearer!r} is at {place:.3g} "
    "{unit}: end the range before",
)
