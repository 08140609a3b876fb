"""The same take through several orientation filters: how far they are apart, and from a reference.

docs/science/filter-comparison.md says how each number is made.
"""

from sagittal.core.filter_comparison.compare import compare_filters
from sagittal.core.filter_comparison.result import FilterComparison, FilterRequest

__all__ = ["FilterComparison", "FilterRequest", "compare_filters"]
