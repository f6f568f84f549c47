"""Seeded orchards with known truth: fruit clouds of one row seen on two visits."""
