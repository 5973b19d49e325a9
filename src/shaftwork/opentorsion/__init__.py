"""Models of openTorsion, its Python objects and its files, as networks."""
