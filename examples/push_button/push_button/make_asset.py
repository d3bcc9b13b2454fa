"""Make assets/button.stl."""

from pathlib import Path

import numpy as np
import trimesh

if __name__ == "__main__":
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rings = [
        np.c_[r * np.cos(turn), r * np.sin(turn), np.full(24, z)]
        for r, z in ((0.05, 0.0), (0.03, 0.06))
    ]
    cap = trimesh.convex.convex_hull(np.vstack(rings))
    cap.export(Path(__file__).parent / "assets/button.stl")
