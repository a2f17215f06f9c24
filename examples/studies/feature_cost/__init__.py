"""What each feature costs when it is on, and what is not done when it is off."""
