"""mcpseg inside a robot's own loop: ``python examples/robot_loop.py examples/office_walk``."""

import sys
from pathlib import Path

from mcpseg_cli.formats.recording import open_recording, read_scan
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter

folder = Path(sys.argv[1])
segmenter = IncrementalSegmenter.load()
door = segmenter.classes.index("door")

for source in open_recording(folder / "scans", folder / "poses.csv"):
    # your sensor driver here: Scan(xyz, rgb, pose, name)
    scan, _ = read_scan(source, frame="map", voxel_size=0.1)

    # label it, the map grows
    update = segmenter.register_scan(scan)

    # semantic, instance and confidence of every point of the scan
    labels = segmenter.labels(update.point_ids)
    ahead = (labels.semantic == door).sum()
    merges = len(update.merges)
    print(f"{scan.name}: {update.num_new} new voxels, {merges} merges, {ahead} points on doors")

for item in sorted(segmenter.objects(), key=lambda item: -item.num_points)[:5]:
    print(f"object {item.id}: {item.class_name}, {item.num_points} points, around {item.centroid}")
