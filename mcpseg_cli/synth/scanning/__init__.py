"""From surfaces to the points a scanner sees."""
