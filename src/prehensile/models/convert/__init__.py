"""Robots and objects of other people made into models that Drake loads.

A URDF, SDF or MJCF file or a bare mesh becomes a folder with one SDF or URDF file, its meshes as
glTF (seen) and OBJ (touched), ``model.yaml``, and a report of everything that was changed:
:func:`prehensile.models.convert.conversion.convert`. URDF stays URDF and SDF stays SDF, since
either holds things that the other cannot say; MJCF and meshes become SDF.
"""
