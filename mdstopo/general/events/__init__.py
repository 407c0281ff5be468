"""Events: found, located, landed on; permanent sets of members, which they change."""
