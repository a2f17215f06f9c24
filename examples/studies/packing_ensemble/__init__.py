"""How soft discs fill space with and without friction: an ensemble of packings, resumable."""
