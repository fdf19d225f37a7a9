"""The order of the figures that ``mcpseg eval`` prints, under headings that say their unit and protocol."""

_CLUSTERS = (
    "objects_true",
    "objects_pred",
    "cluster_ratio",
    "nmi",
    "ami",
    "ari",
    "homogeneity",
    "completeness",
    "v_measure",
)
_OBJECTS = ("object_accuracy", "precision_50", "mcov", "mwcov", "mprec", "mrec")
_PANOPTIC = ("pq", "sq", "rq", "pq_with_stuff", "sq_with_stuff", "rq_with_stuff", "pq_things", "pq_stuff", "pq_dagger")
_PRECISION = ("ap", "ap50", "ap25", "ap_agnostic", "ap50_agnostic", "ap25_agnostic")
_ALL_OBJECTS = (*_OBJECTS, *_PANOPTIC, *_PRECISION)

SECTIONS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "points (unit: {unit}, {over}; pairing: {pairing}; class table from: {classes_from})",
        (
            "points", "covered", "uncovered", "labelled", "unlabelled", "unpredicted", "in_objects", "truth_points",
            "truth_uncovered", "without_room",
        ),
    ),
    (
        "classes (unit: {unit}, {over}; absent classes count 0 in miou, are left out of miou_present)",
        ("point_accuracy", "mean_class_accuracy", "miou", "miou_present", "iou."),
    ),
    ("clusters ({over}; {unit}s of true objects, classes ignored)", _CLUSTERS),
    ("objects ({over}; IoU over 0.5 and same class)", _OBJECTS),
    ("panoptic quality ({over}; every class a thing; with_stuff: ceiling, floor and wall are stuff)", _PANOPTIC),
    ("average precision ({over}; as ScanNet: IoU 0.50 to 0.90, {min_points} {unit}s and more)", _PRECISION),
    ("by room: points and clusters are means over rooms, objects match within rooms", tuple(
        f"rooms.{name}" for name in ("rooms", "point_accuracy", "miou_present", *_CLUSTERS, *_ALL_OBJECTS)
    )),
    ("scans", ("scans", "skipped")),
    ("milliseconds per scan, reading and writing included (events.jsonl)", ("ms_per_scan.",)),
    ("stability of labels (unit: {unit} in a scan, against the scan that saw it before)", ("stability.",)),
    ("map so far, mean over all scans", ("over_scans.mean_miou_present", "over_scans.mean_point_accuracy")),
)  # fmt: skip
"""Headings, and the figures under each: dotted names, or all below a name that ends in a dot."""
