"""Derivatives of frequencies and motions by parameters."""
