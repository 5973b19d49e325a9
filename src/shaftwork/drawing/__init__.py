"""Drawings: a network in the symbols of its trade, or as the analogue circuit; placed without hints.

What is drawn of each part (`items`) is put in order (`layout`, `ordering`) and in its place (`placement`), and becomes
strokes and texts (`canvas`), whose letters are measured once (`texts`). SVG and TikZ are written from these, PDF and
PNG by matplotlib.
"""
