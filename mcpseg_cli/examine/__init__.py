"""What a recording is, as its first scans and its poses show it."""
