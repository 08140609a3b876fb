"""Check the house rules: `python -m tests.lint`, one line per rule."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Final

from tests.lint import architecture, conventions, names, promises, references, sentences

RULES: Final[Mapping[str, Callable[[], list[str]]]] = {
    "core imports only pure packages": architecture.find_impure_imports,
    "every dependency is used": architecture.find_unused_dependencies,
    "no kernel uses fastmath": architecture.find_fastmath,
    "no module is longer than 500 lines": architecture.find_long_modules,
    "only server/storage/fs.py writes files": architecture.find_writers,
    "public class names are unique": names.find_repeated_class_names,
    "function names begin with no participle": names.find_participle_functions,
    "modules of the API have namesakes": names.find_unnamed_api,
    "sentences have at most 25 words": sentences.find_long_sentences,
    "references lead somewhere": references.find_broken_references,
    "nothing outside the repository is mentioned": references.find_outside_mentions,
    "promises have tests": promises.find_untested_promises,
    "tests assert something": conventions.find_tests_without_assertion,
    "only benches limit seconds": conventions.find_timed_assertions,
    "tests lie at mirrored paths": conventions.find_unmirrored_tests,
    "modules have tests": conventions.find_untested_modules,
    "no test waits for a fixed time": conventions.find_fixed_waits,
}


def main() -> int:
    """Print one line per rule, and the violations; 1 if there are any."""
    broken = 0
    for name, find in RULES.items():
        violations = find()
        broken += bool(violations)
        sys.stdout.write(f"{'FAILED' if violations else 'ok    '} {name}\n")
        sys.stdout.writelines(f"    {violation}\n" for violation in violations)
    sys.stdout.write(f"{len(RULES) - broken} passed, {broken} failed\n")
    return 1 if broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
