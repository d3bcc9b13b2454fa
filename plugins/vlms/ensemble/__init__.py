"""Several models at once: each request goes to the one whose answers have earned most for their cost."""
