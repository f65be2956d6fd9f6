"""What the user declares: bodies, what drives them, contact pairs, and the model they make."""
