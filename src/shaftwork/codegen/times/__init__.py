"""The instants at which laws switch because of the time alone."""
