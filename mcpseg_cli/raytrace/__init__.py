"""Virtual scans (paper III-A): a robot drives through a known building and scans it."""
