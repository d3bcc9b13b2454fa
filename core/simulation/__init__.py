"""Try candidates: rollout, playback, guards, several tasks, pictures."""
