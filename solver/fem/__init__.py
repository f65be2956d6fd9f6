"""Bodies discretised: unknowns, strains, forces, stiffness, surfaces, fields."""
