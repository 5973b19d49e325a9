"""Linear models for other tools: python-control, scipy and CSV."""
