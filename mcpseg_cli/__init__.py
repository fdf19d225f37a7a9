"""mcpseg: class and object labels for 3D point clouds while the robot is still scanning."""

__version__ = "0.1.0"
