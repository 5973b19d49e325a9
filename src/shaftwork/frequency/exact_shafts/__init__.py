"""Shafts without a mesh in the frequency domain."""
