"""Networks as text files."""
