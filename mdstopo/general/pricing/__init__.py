"""Prices of candidates of any law, one by one and by interpolation over tiles of a grid."""
