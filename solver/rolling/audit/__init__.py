"""The audit of passes."""
