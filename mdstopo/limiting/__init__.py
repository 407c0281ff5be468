"""Limiting performance: what no members, whatever they are, can do better.

Members are replaced by free forces. The centres of mass then move by linear equations, and the least peak that any
force histories can reach, under the limits of the case, is a linear program in time. Its value is a bound on every
design (Sevin and Pilkey 1971; Balandin, Bolotnik and Pilkey 1998). docs/theory/bound.md derives what is used here.

    known                 known functions of time, cubic in segments
    system                what joints, prescribed motions and floating bodies leave free of the centres' motion
    response              a response or a limit as a row of the program
    force_limits          what the case's own members cannot do: carry more, push, act before their slack is used up
    program               the linear program on finer and finer cells
    solve_linear_program  one of them: its rows, its solution, its certificate
    bounds                a bound for each objective of a case
    compare               bounds beside what a result file holds
"""
