"""``vlmgineer toolbox``: try the tools of finished runs on each other's tasks, and choose few that do most."""
