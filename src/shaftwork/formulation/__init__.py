"""Fewer, independent states: normal tree, state form, explicit rows, diagnosis."""
