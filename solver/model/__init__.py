"""What the user declares: bodies, their loads and motions, contact pairs, and the model."""
