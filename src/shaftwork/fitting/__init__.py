"""Parameters of a network from records of its motion or of its frequency response."""
