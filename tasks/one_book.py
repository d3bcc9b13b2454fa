import numpy as np

from core.geometry import Array
from core.goals import Away, Kept
from core.interfaces import Task
from core.scene import Body, Box, Camera, Geom, Pose, Scene, State, floor, table
from core.values.layouts import around, within
from tasks.assets import board
from tasks.rewards import moved, share

# Along x, along y, and from one book to the next along y.
LENGTH = 0.27
THICKNESS = 0.039
PITCH = 0.04
HEIGHTS = (0.17, 0.168, 0.172, 0.21, 0.22)  # from the robot's right to its left
CENTER_X = 0.6
DENSITY = 600.0  # kg/m^3, paper and board with some air
PULLED_OUT = float(np.hypot(0.14, 0.044))  # metres that the third book must move
OTHERS = ("book_1", "book_2", "book_4", "book_5")

PAGES = (0.95, 0.93, 0.86, 1.0)
COVERS = (
    (0.20, 0.38, 0.62, 1.0),
    (0.36, 0.55, 0.33, 1.0),
    (0.75, 0.22, 0.20, 1.0),
    (0.52, 0.34, 0.58, 1.0),
    (0.85, 0.60, 0.22, 1.0),
)


def book(number: int, row: Pose, height: float, density: float) -> Body:
    """Two boards and a spine (toward the robot) around a block of pages; the collision shape is one box."""
    thin = 0.002
    inset = 0.002
    cover = COVERS[number - 1]
    y = (number - 3) * PITCH
    side = Box((LENGTH, thin, height))
    edge = (THICKNESS - thin) / 2
    visuals = (
        Geom(side, Pose.xyz_rpy((0.0, -edge, 0.0)), cover),
        Geom(side, Pose.xyz_rpy((0.0, edge, 0.0)), cover),
        board((thin, THICKNESS, height), ((thin - LENGTH) / 2, 0.0, 0.0), cover),
        board(
            (LENGTH - inset, THICKNESS - 2 * thin, height - 2 * inset),
            (-inset / 2, 0.0, 0.0),
            PAGES,
        ),
    )
    whole = Box((LENGTH, THICKNESS, height))
    mass = density * whole.volume
    pose = row @ Pose.xyz_rpy((0.0, y, height / 2))
    return Body(f"book_{number}", pose, mass, visuals, (Geom(whole),), friction=0.3)


def holder(name: str, row: Pose, side: float) -> Body:
    """A fixed bookend: an upright plate and a foot that points away from the books."""
    metal = (0.30, 0.32, 0.35, 1.0)
    plate = board((0.20, 0.008, 0.15), (0.0, 0.0, 0.075), metal)
    foot = board((0.20, 0.08, 0.004), (0.0, side * 0.04, 0.002), metal)
    return Body(
        name,
        row @ Pose.xyz_rpy((0.0, side * 0.105, 0.0)),
        0.0,
        (plate, foot),
        (plate, foot),
    )


class OneBook(Task):
    """Pull the middle one of five books out of its row.

    Task: pull the third book out, and leave the others.
    Layouts: in ``near`` the row moves and turns a little, with its bookends; in ``wide`` it stands anywhere in front of
    the robot, the third book is lower or higher, and all books are lighter or heavier.
    Success: the third book moved by 0.15 m, the others together by less than 5 cm.
    """

    name = "OneBook"
    description = (
        "Five books stand upright on the table, side by side between two fixed bookends, their spines toward the "
        "robot. Pull the third one, the red one in the middle, out of the row by at least 0.15 m, and leave the other "
        "four where they are."
    )
    in_words = (
        "Five books stand upright on the table, side by side between two fixed bookends, their spines toward the "
        "robot. Pull the third one, the red one in the middle, out of the row by at least 0.15 m, and leave the other "
        "four where they are."
    )
    success_reward = 0.95  # the paper's goals have no tolerance
    goals = (Away(bodies=("book_3",), away=PULLED_OUT), Kept(OTHERS))
    variations = {
        "near": around("row", (CENTER_X, 0.0), 0.03, 0.3),
        "wide": {
            **within("row", x=(0.55, 0.68), y=(-0.2, 0.2), yaw=(-0.4, 0.4)),
            "book_3.height": (0.155, 0.19),
            "books.density": (400.0, 800.0),
        },
    }
    camera = Camera(position=(1.2, -0.8, 0.75), target=(0.45, 0.0, 0.25))

    def scene(self, seed: int) -> Scene:
        draw = self.draw(seed)
        row = draw.pose("row", (CENTER_X, 0.0, 0.0))
        density = draw("books.density", DENSITY)
        heights = [
            draw(f"book_{i}.height", height)
            for i, height in enumerate(HEIGHTS, start=1)
        ]
        books = tuple(
            book(i, row, height, density) for i, height in enumerate(heights, start=1)
        )
        return Scene(
            (
                floor(),
                table(),
                *books,
                holder("holder_right", row, -1.0),
                holder("holder_left", row, 1.0),
            )
        )

    def reward(self, start: State, end: State) -> Array:
        """1 if the third book is out and the others have not moved; less for a shorter way or for moved neighbours."""

        ways = {name: moved(start, end, name) for name in end.names}
        pulled = ways["book_3"]
        kept = np.exp(-sum(ways[name] for name in OTHERS))
        partial = share(pulled / PULLED_OUT - (1 - kept))
        return np.where(pulled > PULLED_OUT, kept, partial)
