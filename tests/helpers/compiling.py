"""A filter that several test processes want is compiled by one of them; the others wait and read it."""

from __future__ import annotations

import functools
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

from tests.helpers.kept import folder, locked


@functools.cache
def compile_one_at_a_time() -> None:
    """Let this process compile a cached function only while no other one compiles it.

    Files that need the same filters run in several processes at once, and some filters take half a minute.
    """
    compile_anyway, held = Dispatcher.compile, set[str]()

    @functools.wraps(compile_anyway)
    def compile_alone(self: Any, sig: Any) -> Any:
        name = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
        # numba's own lock first, as inside: no thread holds the one and waits for the other
        with global_compiler_lock:
            if not self._cache.cache_path or name in held:
                return compile_anyway(self, sig)
            held.add(name)
            try:
                with locked(folder() / f"{name}.lock"):
                    return compile_anyway(self, sig)
            finally:
                held.remove(name)

    Dispatcher.compile = compile_alone  # type: ignore[method-assign]
