"""Polynomials, collocation tables, points in boxes, zeros: what all stages share; nothing here knows a drive train."""
