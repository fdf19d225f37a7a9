"""Pose files as tools write them: one module for each way of writing poses down."""
