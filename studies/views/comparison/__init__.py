"""Published numbers beside computed ones."""
