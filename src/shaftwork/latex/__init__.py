"""Equations as LaTeX."""
