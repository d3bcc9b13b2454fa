"""Commands that need no run: rewards of the designs in a file, and what a model would be asked."""
