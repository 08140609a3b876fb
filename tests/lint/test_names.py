"""The naming rules detect planted violations."""

from tests.lint.names import find_participles, find_shared_names, find_strangers


def test_the_check_finds_what_it_looks_for() -> None:
    assert find_shared_names({"a.py": "class Line: ...", "b.py": "class Line: ...\nclass _Row: ..."}) == {
        "Line": {"a.py", "b.py"}
    }
    source = "def told(): ...\ndef feed(): ...\ndef edited_events(): ...\ndef _held(): ..."
    assert find_participles(source) == ["told", "edited_events"]


def test_a_module_of_the_api_without_a_namesake_is_found() -> None:
    assert find_strangers(["notes", "films", "schemas"], {"notes"}, {"schemas"}) == ["films"]
    assert find_strangers(["notes"], {"notes"}, {"notes"}) == ["remove the exception: notes"]
