"""Models: meshes from a folder that stand in for some of the synthetic things.

``library`` reads the folder's table of classes, ``meshes`` reads a mesh and cuts it into parts,
``stand_in`` chooses a model for a thing and gives it its colours. A thing's maker asks ``stand_in``
first; where the building has no models, it answers with nothing and draws no random number.
"""
