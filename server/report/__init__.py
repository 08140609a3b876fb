"""Analysis → what a person reads: degrees, words, curves, exports."""
