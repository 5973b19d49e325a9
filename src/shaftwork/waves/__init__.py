"""Shafts as travelling waves: their equations, the engine that follows delays, and phases beside them."""
