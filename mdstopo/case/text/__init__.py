"""The text of a case: YAML as a tree of located nodes, other files it takes, mistakes, and how they are worded."""
