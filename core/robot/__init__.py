"""Hold the arm as data: description, mounts, a tool merged in, kinematics, trajectories and solids."""
