"""How a function is compiled that only other compiled functions call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def inner_njit(**options: bool | str) -> Callable[[Callable[..., Any]], Any]:
    """A decorator like `numba.njit` without what Python and C would call the function by.

    That is a tenth of the time that the ErKF takes to compile. Python that calls such a function all the same
    ends at once, by a segmentation fault.

    Parameters
    ----------
    options : of `numba.njit`, besides those of all our loops.
    """
    made: Callable[[Callable[..., Any]], Any] = numba.njit(
        cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
    )
    return made
