"""The SAPIEN engine."""
