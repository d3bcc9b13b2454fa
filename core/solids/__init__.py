"""Bodies over time: one place for penetration, self-collision, contacts and clearance."""
