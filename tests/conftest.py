"""Settings of all tests; the hooks are in `tests.helpers.plugin`, which validation/ shares."""

pytest_plugins = ("tests.helpers.plugin",)
