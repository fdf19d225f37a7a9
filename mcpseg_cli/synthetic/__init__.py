"""Procedural office buildings in the S3DIS folder layout: labelled point clouds that anyone may use."""
