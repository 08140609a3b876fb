"""Compilation of functions called only from other compiled functions, as far as Numba supports it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, NoReturn

import numba

TESTED: Final = ((0, 61), (0, 68))
"""First and last version of Numba with which the bits were looked at: the same with and without what it does
not promise to keep, the options of `inner_njit` and `UNCOUNTED` and the lanes of the ErKF."""

IS_TESTED: Final = TESTED[0] <= tuple(int(x) for x in numba.__version__.split(".")[:2]) <= TESTED[1]
"""Whether Numba is one of them. With others all is compiled the ordinary way: the same bits, more slowly."""

UNCOUNTED: Final[Mapping[str, bool]] = {"_nrt": False} if IS_TESTED else {}
"""Options for `numba.njit` of a loop that holds arrays but makes none: no counting of references."""

if IS_TESTED:
    from numba.core.registry import CPUDispatcher

    class InnerDispatcher(CPUDispatcher):  # type: ignore[misc]
        """A compiled function without an entry point for Python; compiled callers use it like any other."""

        def __call__(self, *args: object, **kwargs: object) -> NoReturn:
            """Reject a call from Python, for which there is no machine code.

            Raises
            ------
            TypeError Always.
            """
            name = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
            raise TypeError(
                f"{name} is compiled for other compiled functions only and cannot be called from Python. "
                f"To try it, compile it with an entry point of its own: numba.njit({name}.py_func)(…)."
            )


def inner_njit(**options: bool | str) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator like `numba.njit` that compiles no entry points for Python and C.

    Each entry point would be compiled separately, for every function and every signature. A call from Python
    raises TypeError (`InnerDispatcher`); without its `__call__` the interpreter would crash.

    Parameters
    ----------
    options : of `numba.njit`, in addition to those common to all our loops.
    """
    if not IS_TESTED:
        ordinary: Callable[[Callable[..., Any]], Any] = numba.njit(cache=True, nogil=True, **options)
        return ordinary
    compile_function: Callable[[Callable[..., Any]], Any] = numba.njit(
        cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
    )

    def decorate(function: Callable[..., Any]) -> Any:
        compiled = compile_function(function)
        if isinstance(compiled, CPUDispatcher):  # not where NUMBA_DISABLE_JIT leaves the function as it is
            compiled.__class__ = InnerDispatcher
        return compiled

    return decorate
