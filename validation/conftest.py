"""Settings of the validation; the hooks are shared with tests/."""

pytest_plugins = ("tests.helpers.plugin",)
