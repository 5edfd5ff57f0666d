"""Studies: several cases or many operating points, with figures and tables, by one command each."""
