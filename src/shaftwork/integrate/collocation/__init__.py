"""The engine for long chains: collocation with banded systems."""
