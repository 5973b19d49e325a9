"""Lagrange's equations of a network, and the proof that they are Kirchhoff's."""
