"""Scene files: tables, with mesh files beside them, from which a `Scene` is made.

``scene.toml`` -> `description.Description` -> `scene.file_scene` -> `Scene`
"""
