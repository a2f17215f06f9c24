"""What a step costs: by phases, beside one sparse LU of the same matrix, and as scenes grow; resumable."""
