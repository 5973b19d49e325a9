"""Drawings: a network in the symbols of its trade, or as the analogue circuit; placed without hints.

What is drawn of each part (`items`) is put in its place (`layout`) and becomes strokes and texts (`canvas`), which
matplotlib writes as SVG, PDF and PNG; TikZ is written from the same strokes.
"""
