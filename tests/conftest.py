"""Settings of all tests."""

from __future__ import annotations

import hypothesis

# a busy machine must not fail a property: the clock says nothing about it
hypothesis.settings.register_profile(
    "sagittal", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("sagittal")
