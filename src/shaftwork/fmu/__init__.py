"""Functional mock-up units (FMI 2.0 and 3.0): models written as such, and foreign ones as parts of a network."""
