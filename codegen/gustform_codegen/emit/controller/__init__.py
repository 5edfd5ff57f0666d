"""A control as sampled C99: what it reads, gives and remembers, its discrete step, and the folder it is written to."""
