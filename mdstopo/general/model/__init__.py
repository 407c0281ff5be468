"""The arrays of a compiled scene as kernels know them: fields, columns with names, structures, places of unknowns."""
