"""The method, one scan at a time (III-B, III-C, III-E): read ``segmenter`` first."""
