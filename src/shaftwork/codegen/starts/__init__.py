"""Start states, and the states of steady operation."""
