"""gustform: acausal models of grid-forming wind turbines, and the language they are written in."""

__version__ = "0.1.0"
