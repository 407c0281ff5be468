"""What has to be solved for a front, or for utopia and maxima of a run of several objectives: tasks, in rounds.

A task is one optimisation of one scalarisation from one design. What a round is depends on results alone, never on
where or when they were found.
"""
