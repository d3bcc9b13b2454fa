"""Search: designer, evolution, dispatch, and the whole run."""
