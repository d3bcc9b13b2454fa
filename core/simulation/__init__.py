"""Try candidates: rollout, playback, rendering, pictures, penetration and perturbation."""
