"""Cross-sections of rails and wheels, and meshes of them."""
