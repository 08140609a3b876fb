"""Daily-life monitoring: activities over hours and days, from one sensor on the chest or the lower back.

Nazarahari 2021, chapter 7 (docs/science/activity.md). `monitor_activity` processes a recording of any length
block by block; the result is an `ActivityResult` (core/activity/result.py).
"""
