"""Results read, printed and drawn."""
