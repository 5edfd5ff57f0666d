"""Whole turbines, assembled from parts."""
