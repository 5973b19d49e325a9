"""Impacts: speeds that change at once."""
