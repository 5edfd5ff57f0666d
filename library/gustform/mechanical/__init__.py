"""Rotating masses."""
