"""``evolution=map_elites``: keep the best of each kind of tool and motion, and breed from different kinds."""
