"""From keys to the scene: bodies, joints, contacts, points, members, motions, load cases; in a plane and in space."""
