"""What a person does from hour to hour, from one sensor on the chest or the lower back.

Nazarahari 2021, chapter 7 (docs/science/activity.md). `monitor_activity` goes through a recording block by
block, of whatever length; what it finds is an `ActivityResult` (core/activity/result.py).
"""
