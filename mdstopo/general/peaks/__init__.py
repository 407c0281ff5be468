"""States and responses anywhere on the method's own motion; peaks of responses; rows with their gradients."""
