"""Discretised bodies: unknowns, strains, forces, stiffness, surfaces, fields."""
