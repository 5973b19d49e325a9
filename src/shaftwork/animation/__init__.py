"""Motions and mode shapes as moving pictures: discs that turn, slowed down, with twists that can be seen."""
