"""Spectra of a motion: amplitudes over frequency, and over the order of a shaft while its speed changes."""
