"""Motions through the phases of a network whose parts change their mode."""
