"""One self-contained HTML page for a result: motion, responses, convergence, front, the case. No network is needed."""
