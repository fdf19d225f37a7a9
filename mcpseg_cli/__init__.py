"""mcpseg: class and object labels for 3D point clouds while the robot is still scanning.

The package is laid out like the paper and the commands: chapter III is one room, and so is every
command. A room is a folder, or a file of the ground. The ground imports only the ground:

    choices       what may be chosen by name
    errors        expected failures, each one line
    config        settings with their defaults; the numbers of the paper
    classes       class tables: which index means which class
    grid          the one rounding rule: which voxel a coordinate falls into; columns of voxels
    scan          the records of a scan and of its labels
    building      the record of a labelled building
    reliability   whether confidence is the share that is right
    resumable     work that survives being cut short: whole files, one writer, the same request

A folder imports the ground and the rooms named with it, never upward:

    networks/     the networks of the tables and the one that sees the room, their weights
                  files, where they run
    incremental/  the method (III-B, III-C, III-E) and the evidence of all looks;
                  segmenter.py is one scan, read it first; opens no file but weights;
                  imports networks
    formats/      one file a format; recordings, poses, labels, S3DIS
    examine/      what a recording is: frame, unit, upwards, colours; imports formats
    raytrace/     virtual scans of a labelled building (III-A); imports formats
    synth/        synthetic buildings to train on; imports formats
    segment/      a run on disk: scans in, labelled map, checkpoint, events, objects out;
                  imports incremental, networks, formats
    merge/        maps of one building made one, many recordings segmented for it;
                  imports segment, incremental, formats
    train/        samples, losses, epochs, weights (III-D); imports incremental, networks, formats
    evaluate/     scores of a run against the truth (IV-A, IV-B);
                  imports segment, incremental, formats
    export/       what people look at: clouds, pictures, pages, tables, models;
                  imports segment, incremental, networks, formats
    cli/          the commands; imports all, and nobody imports it

torch is imported in networks, incremental, train and export/onnx.py only, typer and rich in cli
only. Commands import what is heavy inside their functions, so that ``mcpseg --help`` answers at
once. The tests mirror the folders; ``tests/test_architecture.py`` holds the rooms to this page.
"""

__version__ = "0.1.0"
