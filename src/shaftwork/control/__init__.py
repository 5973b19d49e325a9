"""Linear models for python-control, scipy and CSV, and what sampled controllers do at their instants."""
