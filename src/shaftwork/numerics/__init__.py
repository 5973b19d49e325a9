"""Polynomials, collocation tables, points in boxes and searches for zeros that all stages share; nothing here knows a drive train."""
