"""Drawings: a network in the symbols of its trade, or as the analogue circuit; placed without hints.

What is drawn of each part (`items`) is put in order (`layout`) and in its place (`placement`), and becomes strokes and
texts (`canvas`). matplotlib writes these as SVG, PDF and PNG; TikZ is written from the same strokes.
"""
