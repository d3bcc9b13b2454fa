"""Check a plugin's part against what every part of its kind must do; each check is a plain function."""
