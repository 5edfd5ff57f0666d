"""Controllers of converters and pitch, and the operating points they are designed for."""
