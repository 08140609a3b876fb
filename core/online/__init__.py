"""The same stages as offline, sample by sample: everything is a pure function of the samples in order."""

from __future__ import annotations
