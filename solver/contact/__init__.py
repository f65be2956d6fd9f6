"""Unilateral contact with friction: geometry, and the problem on the contact points."""
