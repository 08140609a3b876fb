"""Export of finished analyses to other programs (docs/reference/exports.md). Written in the worker, not in
the web process; for the formats see `sagittal.server.export.kinds`.
"""
