"""skmpm: implicit material point method on scikit-fem with Contact Dynamics."""
