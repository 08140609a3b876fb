"""Finished analyses as files for other programs (docs/reference/exports.md). Written in the worker, never in
the web process; what each format needs and is called stands in `sagittal.server.export.kinds`."""
