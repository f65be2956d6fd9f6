"""Unilateral contact with Coulomb friction: geometry, and the problem on the contact points."""
