"""Write plugin packages to start from: ``vlmgineer new``."""
