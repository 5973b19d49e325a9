"""Motions that are stepped from outside, with inputs that are set between the steps: `Model.start`."""
