"""Torsional shafts with distributed inertia: their description and their exact solutions."""
