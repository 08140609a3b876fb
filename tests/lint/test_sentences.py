"""The length rule for sentences detects a planted violation."""

from tests.lint.sentences import too_long


def test_a_long_sentence_is_found() -> None:
    long = " ".join(["word"] * 26)
    assert too_long(f"Notice('code', f'{long[:-5]} {{x}}.')") != []
    assert too_long(f"FormatError('code', 'Short. ' 'W{long[1:-5]}.')") == []
