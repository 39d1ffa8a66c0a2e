"""Generalised travelling-salesman tours: each cluster once, at one node of it, for the least cost."""

from ._nullsweep import Solution, read, solve

__all__ = ["Solution", "read", "solve"]
