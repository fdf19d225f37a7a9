"""Styles, materials and textures."""
