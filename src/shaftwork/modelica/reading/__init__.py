"""Modelica models as networks: tokens, syntax, values, the classes that are read, and what is made of them."""
