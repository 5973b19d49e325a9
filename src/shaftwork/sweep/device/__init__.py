"""Variants side by side on a graphics processor, traced and compiled by JAX."""
