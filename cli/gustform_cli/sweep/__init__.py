"""Campaigns: one scenario with many values, run on all cores of a machine or on a cluster."""
