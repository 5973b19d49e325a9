"""Variants of a network side by side."""
