"""Bodies that roll over each other: passes of a load, in the plane and in space."""
