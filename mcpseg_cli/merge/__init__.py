"""Maps of several recordings made one, and the recordings that are segmented for it."""
