"""Polynomials, collocation tables, points in boxes and zeros that all stages share; nothing here knows a drive train."""
