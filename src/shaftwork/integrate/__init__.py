"""Engines behind one protocol: arrays and functions in, trajectories out."""
