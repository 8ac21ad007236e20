"""Describe recordings and scenes by the same numbers, which need no model."""
