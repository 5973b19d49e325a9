"""Rows as heyoka programs."""
