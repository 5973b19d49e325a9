"""Explicit methods: Dormand and Prince's, compiled, and what runs of any such method have in common."""
