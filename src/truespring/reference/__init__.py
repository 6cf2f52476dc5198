"""Paths from elsewhere: results of other programs."""
