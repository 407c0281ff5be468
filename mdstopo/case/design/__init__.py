"""What is designed: variables, points that move, names that others follow, catalogues, stages, limits on volume."""
