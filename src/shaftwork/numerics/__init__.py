"""Polynomials, collocation tables, points in boxes and zeros that all stages share; nothing knows a drive train."""
