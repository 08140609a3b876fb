"""Comparison of orientation filters on one recording: with each other, and with a reference.

docs/science/filter-comparison.md defines each quantity.
"""

from sagittal.core.filter_comparison.compare import compare_filters
from sagittal.core.filter_comparison.result import FilterComparison, FilterRequest

__all__ = ["FilterComparison", "FilterRequest", "compare_filters"]
