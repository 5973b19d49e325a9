"""Variants side by side whose parts change their mode: guards, and what follows where one is met."""
