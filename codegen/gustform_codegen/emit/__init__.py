"""Printers of C: one module for each kind of output."""
