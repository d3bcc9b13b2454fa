"""Try candidates: rollout, playback, several tasks, pictures."""
