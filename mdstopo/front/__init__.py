"""Fronts of several objectives, and sweeps over keys of a case: what is to be solved, where, and what came of it.

`plan` says what to solve next and knows nothing of processes or files; `tasks` solves one piece; `pool` and `cluster`
spread pieces over processes or machines; `session` brings them together with the result file.
"""
