"""What buildings look like: styles, materials, and how a material is painted.

``styles.Style`` holds what a building's rooms have in common; ``catalogue`` reads the styles from
``synth/styles/`` and draws the one of an area. A ``materials.Material`` is a pattern with colours;
``textures`` paints points with it, out of the noise of ``noise``.
"""
