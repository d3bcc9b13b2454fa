"""MuJoCo Warp: many worlds at once, each with a tool and a layout of its own."""
