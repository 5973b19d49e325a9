"""The way from a network to its motion: what users hold in their hands."""
