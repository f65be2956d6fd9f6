"""Records of passes."""
