"""From a design to the workbench: motions for a real arm, and tools to make (`vlmgineer export`)."""
