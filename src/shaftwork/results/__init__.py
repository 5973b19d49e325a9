"""Questions asked of a motion: quantities by part, energy balance, curves."""
