"""A finished design made a case of its own: fewer members, new sizes, verified, written down."""
