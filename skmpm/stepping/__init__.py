"""How long steps are: what drives a scene, what limits a step, what follows a failure, what a run is warned of."""
