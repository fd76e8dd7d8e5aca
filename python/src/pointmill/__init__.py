"""Runs pointmill, the program that converts laser scans to datasets that renderers stream.

:func:`run` calls the program, :mod:`pointmill.jobs` shares out a conversion, :mod:`pointmill.dask` does so on Dask.
"""

from ._program import PointmillError, find, run

__all__ = ["PointmillError", "find", "run"]
