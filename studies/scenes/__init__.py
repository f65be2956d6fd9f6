"""Scenes as data: a file of tables, and a mesh beside it, become a `Scene` like the built-in ones.

``scene.toml`` -> `description.Description` -> `scene.file_scene` -> `Scene`
"""
