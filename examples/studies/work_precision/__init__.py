"""What an error costs, parameter by parameter, on four scenes: the work-precision study, resumable."""
