"""The engine for linear networks, exact at any step."""
