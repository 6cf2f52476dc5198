"""Paths from elsewhere: results of other programs."""

from truespring.reference.stl import read_stl as read_stl
