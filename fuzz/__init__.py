"""Readers fed with damaged input."""
