"""The naming rules detect planted violations."""

from tests.lint.names import find_participles, find_shared_names


def test_the_check_finds_what_it_looks_for() -> None:
    assert find_shared_names({"a.py": "class Line: ...", "b.py": "class Line: ...\nclass _Row: ..."}) == {
        "Line": {"a.py", "b.py"}
    }
    source = "def told(): ...\ndef feed(): ...\ndef edited_events(): ...\ndef _held(): ..."
    assert find_participles(source) == ["told", "edited_events"]
