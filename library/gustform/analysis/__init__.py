"""What can be said about a turbine and a small grid without simulating them."""
