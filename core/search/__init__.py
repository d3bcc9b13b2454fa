"""Search: designer, evolution, and the whole run."""
