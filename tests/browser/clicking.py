"""Count the clicks a task needs."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import Locator


class Hand:
    """A hand whose every click or tap is counted; typing is not."""

    def __init__(self) -> None:
        self.clicks = 0

    def click(self, target: Locator) -> None:
        """Click or tap."""
        self.clicks += 1
        target.click()

    def pick_files(self, button: Locator, files: list[Path]) -> None:
        """Open the dialog for files and confirm a choice: two clicks."""
        with button.page.expect_file_chooser() as dialog:
            self.click(button)
        self.clicks += 1
        dialog.value.set_files([str(f) for f in files])
